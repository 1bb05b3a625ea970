//! A scenario as it is written.

use std::time::Duration;

use sdr_core::{
    id::{Name, RobotId},
    units::{Bytes, Dbm, Permille},
};

use super::{
    types::{Blow, Cut, Place},
    words::{BitRate, Robots, SeenWord, StateWord, StayWord},
};
use crate::read::{At, Map, Need, table};

table! {
    /// What is played on robots of the lab, and what must come of it: `sdr lab run FILE`.
    pub(crate) struct ScenarioFile {
        /// Its name.
        scenario: Need<At<Name>>,
        /// One sentence about it.
        about: Option<At<String>>,
        /// Robots by name.
        robots: Need<At<Map<RobotEntry>>>,
        /// For robots that do not say otherwise.
        defaults: Option<RobotEntry>,
        /// Who should hold the coordinator role at the start.
        coordinator: Option<At<RobotId>>,
        /// A world of rovers with cameras and wheels.
        world: Option<WorldTable>,
        /// System files that run before time 0; relative paths count from this file.
        systems: Option<At<Vec<At<String>>>>,
        /// Times of the mesh.
        mesh: Option<MeshTimesTable>,
        /// What becomes of components when their agent dies: keep (default) or stop.
        on_agent_death: Option<At<StayWord>>,
        /// The radio of all robots at the start.
        radio: Option<LinkTable>,
        /// What happens and what is expected.
        timeline: Need<At<Vec<At<StepTable>>>>,
        /// When it ends; default: when the last step and expectation are over.
        ends: Option<At<Duration>>,
    }
}

table! {
    /// One robot at the start.
    pub(crate) struct RobotEntry {
        /// What components may use of its memory; default 1.9GB.
        memory: Option<At<Bytes>>,
        /// What components may use of its CPU; then only they count. Default: the machine's cores.
        cpu: Option<At<Permille>>,
        /// Charge; default 80%.
        battery: Option<At<Permille>>,
        /// Free words that a system may ask for.
        labels: Option<At<Vec<String>>>,
        /// Parts of the body that have no file.
        devices: Option<At<Vec<At<Name>>>>,
        /// Where it stands, from the access point; then its level follows from that.
        place: Option<At<Place>>,
        /// A disk of its own for the agent's state, 1MB to 1GB: one that can be full.
        disk: Option<At<Bytes>>,
    }
}

table! {
    /// A world of rovers.
    pub(crate) struct WorldTable {
        /// The robot whose wheels are used; the others follow it.
        driven: At<RobotId>,
    }
}

table! {
    /// Times of the mesh; what is left out is the agent's default.
    pub(crate) struct MeshTimesTable {
        /// Age of the last news at which a robot counts as gone.
        gone_after: Option<At<Duration>>,
        /// Time between two rounds of gossip.
        gossip_period: Option<At<Duration>>,
    }
}

table! {
    /// What is stated of links; what is left out stays, and else follows from the level.
    pub(crate) struct LinkTable {
        /// Whose links; not at the start.
        robots: Option<At<Robots>>,
        /// Mean level at the robot and at its access point.
        level: Option<At<Dbm>>,
        /// How long the level takes to get there; default: none.
        over: Option<At<Duration>>,
        /// Packets lost, whatever retries do; of either kind.
        loss: Option<At<Permille>>,
        /// Single tries that fail: to one receiver there are 7 of them, to all there is one.
        try_loss: Option<At<Permille>>,
        /// Bursts in which much is lost.
        bursts: Option<BurstTable>,
        /// Added to each packet, each way.
        delay: Option<At<Duration>>,
        /// Mean of what is added to that.
        jitter: Option<At<Duration>>,
        /// Bits a second.
        rate: Option<At<BitRate>>,
        /// What may wait for the air; default 256KiB.
        queue: Option<At<Bytes>>,
        /// Corners between the robot and its access point, 0 to 20.
        corners: Option<At<u8>>,
    }
}

table! {
    /// Bursts in which much is lost; a loss of 0% ends them.
    pub(crate) struct BurstTable {
        /// Lost within one.
        loss: At<Permille>,
        /// Mean time between two; default 2s.
        every: Option<At<Duration>>,
        /// Mean time one lasts; default 200ms.
        lasting: Option<At<Duration>>,
    }
}

table! {
    /// One step: a time, and one thing that happens or is expected.
    pub(crate) struct StepTable {
        /// When, after all systems run.
        at: At<Duration>,
        /// Links change.
        link: Option<At<LinkTable>>,
        /// A robot goes somewhere.
        r#move: Option<At<MoveTable>>,
        /// Robots are cut off.
        outage: Option<At<OutageTable>>,
        /// Two sides do not hear each other.
        split: Option<At<SplitTable>>,
        /// Name of a split, or a robot that was cut off: it is over.
        heal: Option<At<String>>,
        /// A charge changes.
        battery: Option<At<BatteryTable>>,
        /// Other programs leave less memory.
        memory: Option<At<MemoryTable>>,
        /// Other programs use the CPU.
        cpu: Option<At<CpuTable>>,
        /// A process gets a signal.
        signal: Option<At<SignalTable>>,
        /// The agent of this robot is started again.
        start: Option<At<RobotId>>,
        /// Power goes, and comes back.
        power_off: Option<At<PowerTable>>,
        /// Power comes back.
        power_on: Option<At<Robots>>,
        /// A disk gets full, empty or slow.
        disk: Option<At<DiskTable>>,
        /// The component `faulty` misbehaves.
        faulty: Option<At<FaultyTable>>,
        /// An operator's command.
        sdr: Option<At<SdrTable>>,
        /// Something must come true.
        expect: Option<At<ExpectTable>>,
    }
}

table! {
    /// A robot goes somewhere.
    pub(crate) struct MoveTable {
        /// Who.
        robot: At<RobotId>,
        /// Where, from the access point.
        to: At<Place>,
        /// How long it takes; default: none.
        over: Option<At<Duration>>,
    }
}

table! {
    /// Robots are cut off from their access point.
    pub(crate) struct OutageTable {
        /// Who.
        robots: At<Robots>,
        /// How long; left out: until `heal`, or for good.
        lasting: Option<At<Duration>>,
        /// both (default), out: not heard; in: hears nothing.
        way: Option<At<Cut>>,
    }
}

table! {
    /// Two sides do not hear each other.
    pub(crate) struct SplitTable {
        /// For `heal`; default `split`.
        name: Option<At<String>>,
        /// One side.
        inside: At<Robots>,
        /// How long; left out: until `heal`, or for good.
        lasting: Option<At<Duration>>,
    }
}

table! {
    /// A charge changes.
    pub(crate) struct BatteryTable {
        /// Whose.
        robot: At<RobotId>,
        /// To what.
        to: At<Permille>,
        /// How long it takes; default: none.
        over: Option<At<Duration>>,
    }
}

table! {
    /// Other programs leave less memory.
    pub(crate) struct MemoryTable {
        /// Where.
        robot: At<RobotId>,
        /// What is left for components.
        available: At<Bytes>,
    }
}

table! {
    /// Other programs use the CPU.
    pub(crate) struct CpuTable {
        /// Where.
        robot: At<RobotId>,
        /// How much; 100% is one core.
        used: At<Permille>,
    }
}

table! {
    /// A process gets a signal.
    pub(crate) struct SignalTable {
        /// The agent of this robot ...
        agent: Option<At<RobotId>>,
        /// ... or a component, all its instances ...
        component: Option<At<Name>>,
        /// ... on this robot; default: wherever it runs.
        robot: Option<At<RobotId>>,
        /// kill (default), term, stop, continue.
        send: Option<At<Blow>>,
    }
}

table! {
    /// Power goes.
    pub(crate) struct PowerTable {
        /// Who.
        robots: At<Robots>,
        /// After which time it comes back, with its agent; left out: with `power_on`, or never.
        back_after: Option<At<Duration>>,
    }
}

table! {
    /// A disk gets full, empty or slow.
    pub(crate) struct DiskTable {
        /// Whose.
        robot: At<RobotId>,
        /// Whether nothing goes in any more; needs `disk` of the robot.
        full: Option<At<bool>>,
        /// How long each write to the platter takes, at most 10s.
        delay: Option<At<Duration>>,
    }
}

table! {
    /// The component `faulty` misbehaves.
    pub(crate) struct FaultyTable {
        /// Its name in the system.
        component: At<Name>,
        /// Only there; default: at its home; with `always` everywhere.
        robot: Option<At<RobotId>>,
        /// What it does, in the words of its README.
        order: At<String>,
    }
}

table! {
    /// An operator's command.
    pub(crate) struct SdrTable {
        /// Whose agent is asked.
        robot: At<RobotId>,
        /// What stands after `sdr`, words split at spaces; `*.yaml` counts from this file.
        run: At<String>,
        /// Whether it must fail; default false.
        fails: Option<At<bool>>,
    }
}

table! {
    /// Something must come true. One subject, and `within` or `lasting`.
    pub(crate) struct ExpectTable {
        /// Subject: a component ...
        component: Option<At<Name>>,
        /// ... is active on this robot,
        home: Option<At<RobotId>>,
        /// ... or on any other,
        home_not: Option<At<RobotId>>,
        /// ... or is in this state.
        state: Option<At<StateWord>>,
        /// Subject: all who answer name this holder of the role.
        coordinator: Option<At<RobotId>>,
        /// Subject: all who answer name the same holder, any but this.
        coordinator_not: Option<At<RobotId>>,
        /// Subject: so many hold the role.
        coordinators: Option<At<u8>>,
        /// Subject: a robot ...
        robot: Option<At<RobotId>>,
        /// ... is taken for alive or gone.
        seen: Option<At<SeenWord>>,
        /// Subject, true: all is active and heard.
        running: Option<At<bool>>,
        /// Subject, true: no process starts or ends, nothing moves.
        unchanged: Option<At<bool>>,
        /// Subject: events of this kind since the step; `component`, `robot`, `reason` narrow it.
        event: Option<At<String>>,
        /// Part of the event's reason.
        reason: Option<At<String>>,
        /// So many events at least; default 1, with `at_most` 0.
        at_least: Option<At<u32>>,
        /// So many events, or lost samples, at most.
        at_most: Option<At<u32>>,
        /// Subject: samples lost on this connection, `at_most` so many.
        lost: Option<At<String>>,
        /// Subject: the longest pause of this connection around the recovery ...
        pause: Option<At<String>>,
        /// ... is no longer.
        no_longer_than: Option<At<Duration>>,
        /// Whose view counts; default: that of the robot concerned, else of all who answer.
        seen_from: Option<At<RobotId>>,
        /// By then, at some moment.
        within: Option<At<Duration>>,
        /// Until then, at every moment.
        lasting: Option<At<Duration>>,
    }
}
