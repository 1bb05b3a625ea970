//! The five steps, each with what it waits for and for how long at most.

mod state;
mod wait;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    time::{Duration, Instant},
};

use sdr_core::{
    api::{DeployAnswer, DeployRequest},
    spec::SystemSpec,
};
use sdr_lab::world::monotonic_ns;
use serde::Deserialize;

pub(crate) use self::state::is_up;

use self::state::{has_moved, progress};
use super::{
    Plan,
    board::{Board, Step},
    ending,
    fleet::{Fleet, Folder},
    stage::{DRIVEN, FADING, Stage},
    system::{self, Available},
    watch::Watch,
};
use crate::{
    Session,
    failure::Failure,
    locate,
    output::Format,
    render::units::{NOTHING, megabytes},
    report::{
        Report,
        extra::{self, Bars, Coordinator, Extra},
        machine::Machine,
    },
};

/// Who gets the system from the operator: the paper's Robot-1.
const RECEIVER: &str = "robot-1";
/// Who is watched while the radio of the receiver fades.
const WITNESS: &str = "robot-2";
/// No policy lies in a folder that is not there: the built-in ones are taken.
const NO_POLICIES: &str = "empty";
/// What leaves the fading robot.
const MOVED: [&str; 2] = ["fisheye", "anomaly"];

/// Plays it.
pub(super) async fn play(plan: &Plan, session: &Session) -> Result<ExitCode, Failure> {
    let folder = Folder::new("sdr-")?;
    let programs = system::executables(folder.path())?;
    locate::all(programs.iter().map(String::as_str))?;
    let world = folder.path().join("w");
    let stage = Stage::start(&world)?;
    let bodies = stage.bodies(&world);
    let fleet = Fleet::start(folder.path(), &bodies, plan.coordinator.as_deref())?;
    let bars = system::bars(&folder.path().join(NO_POLICIES))?;
    let board = Board::new(session, bars);
    let mut watch = Watch::default();
    if let Some(images) = &plan.images {
        watch.say("cameras", &images.sentence());
    }
    let coordinator = Coordinator::default();
    let mut story = Story { fleet, stage, folder, board, bars, watch, plan, session, coordinator };
    story.meet().await?;
    let spec = story.deploy().await?;
    story.drive().await?;
    story.fade().await?;
    let report = story.report(&spec).await?;
    match session.output.format() {
        Format::Json => session.output.json(&report.summary)?,
        Format::Text if plan.keep => {}
        Format::Text => session.output.line(&ending::further())?,
    }
    if plan.keep {
        plan.up.set(true);
        // The signal that ends the demo drops this, and the story with it.
        return std::future::pending().await;
    }
    Ok(ExitCode::SUCCESS)
}

/// The first three are dropped in this order: agents and all they started, the world, and the
/// folder in which both wrote.
struct Story<'a> {
    fleet: Fleet,
    stage: Stage,
    folder: Folder,
    board: Board,
    bars: Bars,
    watch: Watch,
    plan: &'a Plan,
    session: &'a Session,
    coordinator: Coordinator,
}

/// `GET /v1/recording`.
#[derive(Deserialize)]
struct RecordingView {
    path: PathBuf,
}

impl Story<'_> {
    /// Step 1: all agents answer, see each other and have a coordinator.
    async fn meet(&mut self) -> Result<(), Failure> {
        self.board.doing("3 agents started on loopback");
        self.board
            .wait_for(&["three agents that see each other and agree on a coordinator".into()]);
        let wanted = self.plan.coordinator.clone();
        let holder = self
            .wait(Duration::from_secs(20), |story| {
                let holder = story.watch.agreed_coordinator()?;
                let right = wanted.as_deref().is_none_or(|wanted| wanted == holder);
                right.then(|| holder.to_owned())
            })
            .await?;
        self.board
            .finish(format!("3 agents up on loopback, sealed, coordinator {holder}"), Step::Deploy);
        self.coordinator.at_start = Some(holder);
        Ok(())
    }

    /// Step 2: all components are active and heard.
    async fn deploy(&mut self) -> Result<SystemSpec, Failure> {
        let client = &self.fleet.agent(RECEIVER).client;
        let available: Available = client.get("/v1/components").await?;
        let empty = self.folder.path().join(NO_POLICIES);
        let (ballast, images) =
            (self.plan.ballast, self.plan.images.as_ref().map(|one| one.path.as_path()));
        let spec = system::make(&available.components, &empty, ballast, images)?;
        let since = Instant::now();
        let request = DeployRequest { system: spec.clone() };
        let answer: DeployAnswer = client.post("/v1/deploy", &request).await?;
        let why = match ballast {
            true => "each allocates and touches 500 MB, as the paper's do",
            false => "without ballast: they only start, connect and run",
        };
        self.board.wait_for(&["five components active, five connections heard".into(), why.into()]);
        self.wait(Duration::from_secs(60), |story| {
            let system = story.watch.system(RECEIVER).filter(|one| one.revision >= answer.revision);
            story.board.doing(progress(system));
            system.filter(|system| is_up(system)).map(|_| ())
        })
        .await?;
        let took = since.elapsed().as_secs_f64();
        self.board.finish(format!("5 of 5 active, heard after {took:.1} s"), Step::Drive);
        Ok(spec)
    }

    /// Step 3: the robot drives, stops for the object, goes on.
    async fn drive(&mut self) -> Result<(), Failure> {
        if self.plan.images.is_some() {
            // The cameras show a folder's pictures: what stands in the world is not seen.
            self.board
                .wait_for(&["the cameras to have shown some of the folder's pictures".into()]);
            self.let_pass(Duration::from_secs(8)).await?;
        } else {
            self.stop_for_the_object().await?;
        }
        let text = self.driven();
        self.board.finish(text, Step::Fade);
        Ok(())
    }

    async fn stop_for_the_object(&mut self) -> Result<(), Failure> {
        self.board.wait_for(&["the robot to drive".into()]);
        self.wait_for_motion(true).await?;
        self.let_pass(Duration::from_secs(3)).await?;
        self.stage.show_object()?;
        self.watch.say("world", "a dangerous object stands before the robot");
        self.board.wait_for(&[
            "the robot to stop: anomaly must see the object and tell controller".into(),
        ]);
        self.wait_for_motion(false).await?;
        self.let_pass(Duration::from_millis(1500)).await?;
        self.stage.hide_object();
        self.watch.say("world", "the object is gone");
        self.board.wait_for(&["the robot to go on: nothing dangerous is seen any more".into()]);
        self.wait_for_motion(true).await?;
        self.let_pass(Duration::from_millis(1500)).await
    }

    /// Step 4: the radio fades, the condition holds, two components move.
    async fn fade(&mut self) -> Result<(), Failure> {
        self.stage.fade()?;
        let radio = Stage::radio();
        let text = format!("radio fades: {:.1} -> {:.1} dBm", radio.from_dbm, radio.to_dbm);
        self.watch.say(FADING, &text);
        let size = |bytes: Option<u64>| bytes.map_or_else(|| NOTHING.to_owned(), megabytes);
        let hold = self.bars.recovery_rssi_hold_s.unwrap_or(0.0);
        let (first, relaxed) =
            (size(self.bars.allocation_memory_bytes), size(self.bars.relaxed_memory_bytes));
        self.board.wait_for(&[
            format!("rssi-low on {FADING} to hold for {hold} s, then fisheye and anomaly"),
            format!("move to where {relaxed} stay free (relaxed bar); allocation wants {first}"),
        ]);
        self.wait(Duration::from_secs(60), |story| {
            let text = story.fading();
            story.board.doing(text);
            story.watch.system(WITNESS).filter(|system| has_moved(system)).map(|_| ())
        })
        .await?;
        self.board.wait_for(&["the new homes to settle".into()]);
        self.let_pass(Duration::from_secs(4)).await?;
        let system = self.watch.system(WITNESS);
        let component = system.and_then(|system| {
            system.components.iter().find(|component| component.name == MOVED[0])
        });
        let home = component.and_then(|component| component.home.clone()).unwrap_or_default();
        let epoch = component.map_or(0, |component| component.epoch);
        let text = format!("fisheye, anomaly: {FADING} -> {home}, epoch {epoch}");
        self.board.finish(text, Step::Report);
        Ok(())
    }

    /// Step 5: the recordings become a report; the fleet ends, unless it is kept.
    async fn report(&mut self, spec: &SystemSpec) -> Result<Report, Failure> {
        self.board.wait_for(&["recordings, then the report".into()]);
        self.watch.look(&self.fleet).await;
        self.board.show(self.session, &self.watch)?;
        self.coordinator.at_end = self.watch.agreed_coordinator().map(str::to_owned);
        let until_ns = monotonic_ns();
        let mut recordings = Vec::new();
        for agent in &self.fleet.agents {
            let view: RecordingView = agent.client.get("/v1/recording").await?;
            recordings.push(copy(&view.path, self.plan.out.path())?);
        }
        let extra = self.extra(spec, until_ns);
        if !self.plan.keep {
            let path = format!("/v1/systems/{}", spec.name);
            // Ending the agents ends the system as well.
            let _ = self.fleet.agent(RECEIVER).client.delete(&path).await;
            self.fleet.stop();
        }
        let text =
            serde_json::to_string(&extra).map_err(|error| Failure::new(error.to_string()))?;
        let file = self.plan.out.path().join(extra::FILE);
        std::fs::write(&file, text)
            .map_err(|error| Failure::new(format!("cannot write {}: {error}", file.display())))?;
        let report = Report::make(&recordings, extra)?;
        let page = report.write(self.plan.out.path())?;
        self.board.finish(page.display().to_string(), Step::Report);
        self.board.show(self.session, &self.watch)?;
        let mut lines = ending::lines(&report, &page);
        if self.plan.keep {
            lines.extend(ending::kept(self.fleet.agent(RECEIVER).socket()));
        }
        self.board.end(self.session, &lines)?;
        Ok(report)
    }

    fn extra(&self, spec: &SystemSpec, until_ns: u64) -> Extra {
        Extra {
            ballast: Some(self.plan.ballast),
            machine: Some(Machine::here()),
            radio: Some(Stage::radio()),
            bars: Some(self.bars),
            coordinator: self.coordinator.clone(),
            components: spec.components.iter().map(|one| one.name.to_string()).collect(),
            connections: spec.connections.iter().map(|one| one.label()).collect(),
            until_ns: Some(until_ns),
            position_topic: Some(format!("/{}/position/odometry", spec.name)),
            truth: self.stage.truth(),
            commands_ns: self.stage.commands_ns(),
            detector: self.plan.images.is_none().then(|| self.stage.detector(until_ns)),
            pictures: self.plan.images.as_ref().map(|images| images.sentence()),
            danger_topic: Some(format!("/{}/anomaly/danger", spec.name)),
            lab: None,
        }
    }

    /// `3.1 m, stopped 1 time`.
    fn driven(&self) -> String {
        match self.stage.driven() {
            None => String::new(),
            Some(rover) => {
                let times = crate::render::units::count(rover.stops as usize, "time");
                format!("{DRIVEN} drove {:.1} m, stopped {times}", rover.distance_m)
            }
        }
    }

    /// `robot-1 at -55.0 dBm, bar -52.5 dBm, held 4.2 of 6.0 s`.
    fn fading(&self) -> String {
        let level = self.watch.itself(FADING).and_then(|view| view.rssi_dbm);
        let level = level.map_or_else(|| "unknown".to_owned(), |level| format!("{level:.1} dBm"));
        let conditions = self.watch.statuses.get(FADING).map(|status| &status.conditions);
        let held = conditions.and_then(|list| list.iter().find(|one| one.cause == "rssi-low"));
        let held = held.map(|one| {
            let part = |ms: u64| Duration::from_millis(ms).as_secs_f64();
            format!(", held {:.1} of {:.1} s", part(one.held_ms), part(one.hold_ms))
        });
        let bar = crate::render::units::level(self.bars.recovery_rssi_dbm);
        format!("{FADING} at {level}, bar {bar} dBm{}", held.unwrap_or_default())
    }
}

/// Copies a recording into the folder of reports.
fn copy(recording: &Path, out: &Path) -> Result<PathBuf, Failure> {
    let name = recording.file_name().unwrap_or_default();
    let to = out.join(name);
    std::fs::copy(recording, &to).map_err(|error| {
        Failure::new(format!("cannot copy {} to {}: {error}", recording.display(), to.display()))
    })?;
    Ok(to)
}
