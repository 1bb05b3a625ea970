//! One seed draws everything: fleet, places, radio, clocks, faults, operators.

use std::time::Duration;

use sdr_core::recover::Cause;

use super::{
    Behaviour, Chance, ClockFate, DiskFate, Fault, Incident, Setup, Way, Weather, edition, systems,
};

/// Faults of a component's own, at most: its ladder must not end in `hold`.
const KILLS_MAX: usize = 3;
/// Share of the runs in whose systems components wish for standbys.
const STANDBYS: f64 = 0.35;

/// A drawn run: the fleet, and what happens to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// What draws the rest of chance: loss, delays, order.
    pub seed: u64,
    /// Robots.
    pub robots: usize,
    /// The radio while faults last.
    pub weather: Weather,
    /// Where the robots stand, metres from the middle; empty when places do not matter.
    pub places: Vec<(f64, f64)>,
    /// Clocks run fast or slow by at most so many millionths.
    pub drift_ppm_max: usize,
    /// What happens, in order.
    pub incidents: Vec<Incident>,
    /// When faults stop, counted from the beginning.
    pub calm_after: Duration,
}

impl Scenario {
    /// Everything that `seed` draws.
    pub fn draw(seed: u64) -> Self {
        let mut chance = Chance::stream(seed, 10);
        let robots = if chance.happens(0.06) { 2 } else { chance.between(3, 8) };
        let calm_after = chance.time(Duration::from_secs(35), Duration::from_secs(80));
        let mut scenario = Self {
            seed,
            robots,
            weather: weather(&mut chance),
            places: places(&mut chance, robots),
            drift_ppm_max: chance.below(3) * 100,
            incidents: Vec::new(),
            calm_after,
        };
        let mut backing = Chance::stream(seed, 11);
        let backing = backing.happens(STANDBYS).then_some(backing);
        let mut draw = Draw { robots, calm_after, kills: 0, for_good: false, chance, backing };
        scenario.incidents = draw.incidents();
        scenario
    }

    /// The same with only these incidents, by their place in the list, from 1.
    #[must_use]
    pub fn only(&self, numbers: &[usize]) -> Self {
        let kept = self.incidents.iter().enumerate();
        let kept = kept.filter(|(index, _)| numbers.contains(&(index + 1)));
        Self { incidents: kept.map(|(_, incident)| incident.clone()).collect(), ..self.clone() }
    }

    /// The fleet before anything happens.
    pub fn setup(&self) -> Setup {
        let mut setup = Setup::new(self.robots, self.seed);
        setup.weather = self.weather.clone();
        setup.drift_ppm_max = self.drift_ppm_max;
        setup
    }
}

fn weather(chance: &mut Chance) -> Weather {
    let mut weather = Weather::fair();
    weather.delay = chance.time(Duration::from_micros(300), Duration::from_millis(10));
    weather.jitter = chance.time(Duration::from_micros(300), Duration::from_millis(8));
    if chance.happens(0.7) {
        weather.loss = chance.uniform() * 0.25;
    }
    if chance.happens(0.4) {
        weather.burst_loss = 0.5 + chance.uniform() * 0.5;
        weather.burst_every = chance.time(Duration::from_secs(2), Duration::from_secs(20));
        weather.burst_for = chance.time(Duration::from_millis(50), Duration::from_millis(1500));
    }
    if chance.happens(0.5) {
        weather.late = chance.uniform() * 0.1;
    }
    if chance.happens(0.5) {
        weather.twice = chance.uniform() * 0.1;
    }
    weather
}

fn places(chance: &mut Chance, robots: usize) -> Vec<(f64, f64)> {
    if chance.happens(0.5) {
        return Vec::new();
    }
    let width = 20.0 + chance.uniform() * 200.0;
    let along = |chance: &mut Chance| (chance.uniform() - 0.5) * width;
    (0..robots).map(|_| (along(chance), along(chance))).collect()
}

/// Draws incidents one after the other.
struct Draw {
    robots: usize,
    calm_after: Duration,
    kills: usize,
    for_good: bool,
    chance: Chance,
    /// Draws standbys, apart from all else; `None`: nothing wishes for any.
    backing: Option<Chance>,
}

impl Draw {
    fn incidents(&mut self) -> Vec<Incident> {
        let systems = self.chance.between(1, 3);
        let mut incidents = Vec::new();
        let mut after = Duration::from_millis(500);
        for system in 0..systems {
            after += self.chance.time(Duration::from_millis(100), Duration::from_secs(4));
            incidents.push(Incident { after, fault: self.deploy(system) });
        }
        loop {
            after += self.gap();
            if after + Duration::from_secs(1) >= self.calm_after {
                return incidents;
            }
            let left = self.calm_after - after;
            let fault = self.fault(systems, left);
            let worse = self.worse(&fault, left);
            incidents.push(Incident { after, fault });
            incidents.extend(worse.map(|(later, fault)| Incident { after: after + later, fault }));
        }
    }

    /// Faults come in swarms, with calm between in which things must come right.
    fn gap(&mut self) -> Duration {
        let (low, high) = match self.chance.below(20) {
            0..=9 => (50, 3000),
            10..=16 => (3000, 10_000),
            _ => (17_000, 24_000),
        };
        self.chance.time(Duration::from_millis(low), Duration::from_millis(high))
    }

    fn time(&mut self, low_ms: u64, high_ms: u64, left: Duration) -> Duration {
        let time = self.chance.time(Duration::from_millis(low_ms), Duration::from_millis(high_ms));
        time.min(left)
    }

    fn fault(&mut self, systems: usize, left: Duration) -> Fault {
        let robot = self.chance.below(self.robots);
        match self.chance.below(34) {
            0..=3 => self.crash(robot, left),
            4..=5 => Fault::CrashAtStore { robot, down: self.time(100, 8000, left) },
            6..=8 => self.pause(robot, left),
            9..=12 => Fault::Deaf { robot, time: self.time(1000, 10_000, left) },
            13 => {
                let loss = 0.3 + self.chance.uniform() * 0.4;
                Fault::Storm { loss, time: self.time(2000, 8000, left) }
            }
            14..=16 => self.cut(Way::Both, left),
            17 => self.cut(Way::Out, left),
            18..=19 => Fault::CutOffCoordinator { time: self.time(3000, 30_000, left) },
            20 => Fault::DiskFull { robot, time: self.time(2000, 10_000, left) },
            21 => {
                let each = self.time(20, 800, left);
                Fault::DiskSlow { robot, each, time: self.time(4000, 20_000, left) }
            }
            22..=24 if self.kills < KILLS_MAX => self.component(robot, systems, left),
            25 => Fault::Fade { robot, level_dbm: -84, time: self.time(8000, 20_000, left) },
            26..=27 => Fault::Undeploy { robot, system: self.system_name(systems) },
            28 => Fault::MoveRole { robot, to: self.chance.below(self.robots) },
            29 => {
                let policy = Box::new(edition::role_policy(&mut self.chance, self.robots));
                Fault::RolePolicy { robot, policy }
            }
            _ => {
                let system = self.chance.below(systems);
                self.deploy(system)
            }
        }
    }

    /// A full disk often meets a start, or power that fails while nothing can be written.
    fn worse(&mut self, fault: &Fault, left: Duration) -> Option<(Duration, Fault)> {
        let Fault::DiskFull { robot, .. } = fault else { return None };
        if self.chance.happens(0.5) {
            return None;
        }
        let later = self.time(0, 3000, left);
        let down = Some(self.time(100, 3000, left - later));
        Some((later, Fault::Crash { robot: *robot, down, disk: DiskFate::Kept }))
    }

    fn crash(&mut self, robot: usize, left: Duration) -> Fault {
        let lost = self.chance.happens(0.3);
        let disk = if lost { DiskFate::Lost } else { DiskFate::Kept };
        if self.robots >= 4 && !self.for_good && self.chance.happens(0.08) {
            self.for_good = true;
            return Fault::Crash { robot, down: None, disk };
        }
        Fault::Crash { robot, down: Some(self.time(100, 25_000, left)), disk }
    }

    fn pause(&mut self, robot: usize, left: Duration) -> Fault {
        let clock = match self.chance.happens(0.3) {
            true => ClockFate::Sleeps,
            false => ClockFate::Runs,
        };
        Fault::Pause { robot, time: self.time(300, 12_000, left), clock }
    }

    fn cut(&mut self, way: Way, left: Duration) -> Fault {
        let mut inside: Vec<usize> =
            (0..self.robots).filter(|_| self.chance.happens(0.5)).collect();
        if inside.is_empty() || inside.len() == self.robots {
            inside = vec![self.chance.below(self.robots)];
        }
        Fault::Cut { inside, way, time: self.time(2000, 30_000, left) }
    }

    fn component(&mut self, robot: usize, systems: usize, left: Duration) -> Fault {
        self.kills += 1;
        let component = systems::component_name(self.chance.below(systems), self.chance.below(2));
        let usual = Behaviour::default();
        let behaviour = match self.chance.below(5) {
            0 => return Fault::Exit { component },
            1 => return Fault::Hang { component },
            2 => Behaviour { initialise: self.time(500, 8000, left), ..usual },
            3 => Behaviour { crash_after: Some(self.time(50, 1500, left)), ..usual },
            _ => {
                let after = self.time(50, 1500, left);
                Behaviour { fail_after: Some((after, Cause::HardwareLost)), ..usual }
            }
        };
        Fault::Behave { robot, component, behaviour, time: self.time(3000, 8000, left) }
    }

    fn system_name(&mut self, systems: usize) -> sdr_core::id::Name {
        systems::name("system", self.chance.below(systems))
    }

    /// A system in one of its editions: other needs, other length, other policy.
    fn deploy(&mut self, number: usize) -> Fault {
        let robot = self.chance.below(self.robots);
        let mut system = edition::system(&mut self.chance, number);
        if let Some(chance) = &mut self.backing {
            edition::back_up(chance, &mut system);
        }
        Fault::Deploy { robot, system: Box::new(system) }
    }
}
