//! What holds for every course of events.

mod build;

use build::{at, evidence, exploration, fault, key};
use proptest::{collection::vec, prelude::*, sample::select, test_runner::RngSeed};
use sdr_core::{
    recover::{Cause, Evidence, Recovery, Remedy, RemedyOutcome, Verdict},
    spec::PolicyBytes,
    units::{Bytes, Dbm, Permille},
};
use sdr_recovery::{Engine, Policy};

/// One thing that happens, some time after the one before.
#[derive(Clone, Debug)]
struct Happening {
    after_ms: u64,
    what: What,
}

#[derive(Clone, Debug)]
enum What {
    Rssi(Option<i16>),
    Memory(u64),
    Cpu(u32),
    Fails(usize, Cause),
    Answer(usize, RemedyOutcome),
    Leaves(usize),
    Nothing,
}

const WORDS: [&str; 2] = ["fisheye", "anomaly"];

fn happening() -> impl Strategy<Value = Happening> {
    let causes = vec![Cause::Exited, Cause::Hung, Cause::HardwareLost, Cause::EmergencyStop];
    let outcomes = vec![RemedyOutcome::Done, RemedyOutcome::Refused];
    let what = prop_oneof![
        prop::option::weighted(0.9, -900_i16..-400).prop_map(What::Rssi),
        (0_u64..500).prop_map(What::Memory),
        (0_u32..1100).prop_map(What::Cpu),
        (0_usize..2, select(causes)).prop_map(|(who, cause)| What::Fails(who, cause)),
        (0_usize..2, select(outcomes)).prop_map(|(who, outcome)| What::Answer(who, outcome)),
        (0_usize..2).prop_map(What::Leaves),
        Just(What::Nothing),
    ];
    (1_u64..12_000, what).prop_map(|(after_ms, what)| Happening { after_ms, what })
}

/// Plays a course of events, waking the engine at its deadlines, and `every_ms` if given;
/// returns each verdict with its moment.
fn play(policy: Policy, course: &[Happening], every_ms: Option<u64>) -> Vec<(u64, Verdict)> {
    let mut engine = Engine::new(policy);
    let mut all: Vec<Evidence> = WORDS.map(evidence).to_vec();
    let (mut now, mut verdicts) = (0, Vec::new());
    let mut judge = |engine: &mut Engine, all: &mut Vec<Evidence>, now: u64| {
        let found = engine.judge(at(now), all);
        all.iter_mut().for_each(|one| one.fault = None);
        verdicts.extend(found.into_iter().map(|verdict| (now, verdict)));
        let due = engine.next_deadline();
        assert!(due.is_none_or(|due| due > at(now)), "a deadline lies in the past");
    };
    judge(&mut engine, &mut all, now);
    for happening in course {
        let until = now + happening.after_ms;
        loop {
            let due = engine.next_deadline().map(|due| due.as_nanos().div_ceil(1_000_000));
            let tick = every_ms.map(|every| (now / every + 1) * every);
            let Some(next) = due.into_iter().chain(tick).min().filter(|next| *next < until) else {
                break;
            };
            now = next.max(now);
            judge(&mut engine, &mut all, now);
        }
        now = until;
        match &happening.what {
            What::Rssi(tenths) => {
                let rssi = tenths.map(Dbm::from_tenths);
                all.iter_mut().for_each(|one| one.robot.rssi = rssi);
            }
            What::Memory(mega) => {
                let free = Some(Bytes::mega(*mega));
                all.iter_mut().for_each(|one| one.robot.memory_free = free);
            }
            What::Cpu(share) => all[0].cpu = Permille(*share),
            What::Fails(who, cause) => all[*who].fault = fault(*cause),
            What::Answer(who, outcome) => engine.outcome(at(now), &key(WORDS[*who]), *outcome),
            What::Leaves(who) => engine.forget(&key(WORDS[*who])),
            What::Nothing => {}
        }
        judge(&mut engine, &mut all, now);
    }
    verdicts
}

fn severity(remedy: Remedy) -> u8 {
    match remedy {
        Remedy::LocalStandby => 0,
        Remedy::Restart { .. } => 1,
        Remedy::StandbyElsewhere => 2,
        Remedy::LaunchElsewhere => 3,
        Remedy::Hold => 4,
    }
}

proptest! {
    // One commit, one answer; PROPTEST_CASES looks further.
    #![proptest_config(ProptestConfig {
        rng_seed: RngSeed::Fixed(20_261_122),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn the_same_course_gives_the_same_verdicts(course in vec(happening(), 0..60)) {
        let first = play(Policy::default(), &course, None);
        prop_assert_eq!(first, play(Policy::default(), &course, None));
    }

    #[test]
    fn looking_more_often_than_asked_changes_nothing(course in vec(happening(), 0..40)) {
        for policy in [Policy::default(), exploration()] {
            let seldom = play(policy.clone(), &course, None);
            let often = play(policy, &course, Some(137));
            prop_assert_eq!(seldom, often);
        }
    }

    #[test]
    fn a_ladder_never_climbs_down_within_a_climb(
        gaps in vec(1_u64..9_000, 1..30),
        answers in vec(select(vec![RemedyOutcome::Done, RemedyOutcome::Refused]), 30),
        standbys in vec(any::<(bool, bool)>(), 30),
    ) {
        let mut engine = Engine::new(Policy::default());
        let mut one = evidence("camera");
        let (mut now, mut highest) = (0, 0);
        for (index, gap) in gaps.into_iter().enumerate() {
            now += gap;
            (one.standby_here, one.standby_elsewhere) = standbys[index];
            one.fault = fault(Cause::Exited);
            for verdict in engine.judge(at(now), core::slice::from_ref(&one)) {
                let found = severity(verdict.remedy);
                prop_assert!(found >= highest, "{} after {highest}", verdict.remedy.word());
                highest = found;
                engine.outcome(at(now), &one.component, answers[index]);
            }
            if highest >= 2 {
                break; // it left, or is held: another climb
            }
        }
    }

    #[test]
    fn no_hour_has_more_restarts_than_its_budget(gaps in vec(1_u64..60_000, 1..200)) {
        let mut engine = Engine::new(Policy::default());
        let mut one = evidence("camera");
        let (mut now, mut restarts) = (0, Vec::new());
        for gap in gaps {
            now += gap;
            one.fault = fault(Cause::Exited);
            for verdict in engine.judge(at(now), core::slice::from_ref(&one)) {
                if matches!(verdict.remedy, Remedy::Restart { .. }) {
                    restarts.push(now);
                }
                engine.outcome(at(now), &one.component, RemedyOutcome::Done);
            }
        }
        for eleven in restarts.windows(11) {
            prop_assert!(eleven[10] - eleven[0] >= 3_600_000);
        }
    }

    #[test]
    fn any_bytes_are_a_policy_or_an_error(bytes in vec(any::<u8>(), 0..600)) {
        let _ = Policy::decode(&PolicyBytes { name: "any".into(), bytes });
    }
}
