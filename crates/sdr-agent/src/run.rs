//! The only loop in the program.

use sdr_core::{brain::Brain, effect::Effect, input::Input, report::HoldReport};
use tokio::sync::watch;

use crate::api::Question;
use crate::clock;
use crate::world::World;

/// Why the agent ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// It does not.
    NotYet,
    /// Told by a signal: components go on when they are to be kept.
    Leave,
    /// Told by an operator: everything ends.
    All,
    /// It makes way for another version of itself, which goes on with what runs.
    Upgrade,
}

/// Runs the agent until told to end; says how.
pub(crate) async fn run(
    mut brain: Box<Brain>,
    world: &mut World,
    mut ending: watch::Receiver<Ending>,
) -> Ending {
    for input in std::mem::take(&mut world.adopted) {
        step(&mut brain, world, input);
    }
    let told = loop {
        let input = tokio::select! {
            Ok(told) = ending.wait_for(|ending| *ending != Ending::NotYet) => break *told,
            () = clock::sleep_until(brain.next_deadline()) => Input::Tick,
            Some(input) = world.inputs.recv() => input,
            Some(question) = world.questions.recv() => {
                answer(&brain, question);
                continue;
            }
        };
        step(&mut brain, world, input);
    };
    if told == Ending::Upgrade {
        step(&mut brain, world, Input::Hold { time: HoldReport::TIME_MAX });
    }
    told
}

fn step(brain: &mut Brain, world: &mut World, input: Input) {
    let second_passed = matches!(input, Input::Usage(_));
    // Once a second, and whenever routes change: samples name the robot that minted their
    // epoch only by a hash.
    let mut robots_due = second_passed;
    brain.handle(clock::now(), input);
    while let Some(effect) = brain.poll_effect() {
        robots_due |= matches!(effect, Effect::Routes(_));
        world.effects.carry_out(effect);
    }
    if robots_due {
        world.name_robots(brain);
    }
    if second_passed {
        world.mesh_watch.look(brain.mesh_counters());
    }
}

fn answer(brain: &Brain, question: Question) {
    // Whoever asked may have gone.
    match question {
        Question::Status(asker) => drop(asker.send(brain.status(clock::now()))),
        Question::Mesh(asker) => drop(asker.send(brain.mesh_counters())),
    }
}
