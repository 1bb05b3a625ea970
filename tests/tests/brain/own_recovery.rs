//! A recovery of one's own, for what no policy file can say: during the last minute of a
//! mission nothing moves, whatever the policy wants; restarts go on.

use std::time::Duration;

use sdr_core::{
    id::ComponentKey,
    recover::{
        Cause, CauseStatus, Evidence, Foresight, GuardPolicy, Recovery, Remedy, RemedyOutcome,
        RobotEvidence, Verdict,
    },
    spec::PolicyBytes,
    time::Instant,
};
use sdr_recovery::{Engine, Policy};
use sdr_tests::{fleet::Fleet, systems::exploration};

const LONG: Duration = Duration::from_secs(30);
/// The mission of this test: it ends so long after its robot had something to run.
const MISSION: Duration = Duration::from_secs(70);
const LAST: Duration = Duration::from_secs(60);

/// The usual engine, with its wishes to leave refused near the end of a mission.
struct Mission {
    engine: Engine,
    began_at: Option<Instant>,
}

impl Mission {
    fn is_in_its_last_minute(&self, now: Instant) -> bool {
        let elapsed = self.began_at.map(|at| now.since(at));
        elapsed.is_some_and(|elapsed| (MISSION - LAST..MISSION).contains(&elapsed))
    }
}

fn make(policy: &PolicyBytes) -> Result<Box<dyn Recovery + Send>, String> {
    let policy = Policy::decode(policy).map_err(|error| error.to_string())?;
    Ok(Box::new(Mission { engine: Engine::new(policy), began_at: None }))
}

fn leaves(verdict: &Verdict) -> bool {
    match verdict.remedy {
        Remedy::StandbyElsewhere | Remedy::LaunchElsewhere => true,
        Remedy::LocalStandby | Remedy::Restart { .. } | Remedy::Hold => false,
    }
}

impl Recovery for Mission {
    fn judge(&mut self, now: Instant, evidence: &[Evidence]) -> Vec<Verdict> {
        if !evidence.is_empty() {
            self.began_at.get_or_insert(now);
        }
        let near_its_end = self.is_in_its_last_minute(now);
        let verdicts = self.engine.judge(now, evidence);
        let (refused, passed): (Vec<Verdict>, Vec<Verdict>) =
            verdicts.into_iter().partition(|verdict| near_its_end && leaves(verdict));
        for verdict in refused {
            // As if no robot had room: the engine asks again, ever slower.
            self.engine.outcome(now, &verdict.component, RemedyOutcome::Refused);
        }
        passed
    }

    fn outcome(&mut self, now: Instant, component: &ComponentKey, outcome: RemedyOutcome) {
        self.engine.outcome(now, component, outcome);
    }

    fn forget(&mut self, component: &ComponentKey) {
        self.engine.forget(component);
    }

    fn next_deadline(&self) -> Option<Instant> {
        self.engine.next_deadline()
    }

    fn standing(&self) -> Vec<CauseStatus> {
        self.engine.standing()
    }

    fn foreseen(&self) -> Vec<Foresight> {
        self.engine.foreseen()
    }

    fn has_rule(&self, component: &ComponentKey, cause: Cause) -> bool {
        self.engine.has_rule(component, cause)
    }

    fn objection(&self, robot: &RobotEvidence) -> Option<(Cause, String)> {
        self.engine.objection(robot)
    }

    fn not_back_for(&self, component: &ComponentKey) -> Duration {
        self.engine.not_back_for(component)
    }

    fn guard(&self) -> GuardPolicy {
        self.engine.guard()
    }
}

#[test]
fn nothing_moves_in_the_last_minute_of_a_mission_and_what_waited_moves_after_it() {
    let mut fleet = Fleet::new(3, 51);
    for number in 0..3 {
        fleet.robots[number].recovery = make;
        fleet.switch_off(number);
        fleet.switch_on(number);
        fleet.set_rssi(number, -47.0);
    }
    fleet.run(Duration::from_secs(2));
    fleet.deploy(0, &exploration());
    let deployed = fleet.now;
    fleet.run_until(LONG, "all active", |fleet| fleet.is_running("exploration"));
    fleet.run(Duration::from_secs(10));

    fleet.set_rssi(0, -55.0);
    fleet.run(Duration::from_secs(40));
    assert_eq!(fleet.events("moved"), [], "{}", fleet.story());

    fleet.run_until(Duration::from_secs(90), "moved", |fleet| fleet.events("moved").len() == 2);
    let moved = fleet.events("moved")[0].0.since(deployed);
    assert!(moved >= MISSION, "{moved:?}\n{}", fleet.story());
}
