//! The only loop in the program.

use sdr_core::{brain::Brain, effect::Effect, input::Input};
use tokio::sync::watch;

use crate::api::Question;
use crate::clock;
use crate::world::World;

/// Runs the agent until told to stop.
pub(crate) async fn run(mut brain: Box<Brain>, world: &mut World, mut stop: watch::Receiver<bool>) {
    loop {
        let input = tokio::select! {
            _ = stop.changed() => break,
            () = clock::sleep_until(brain.next_deadline()) => Input::Tick,
            Some(input) = world.inputs.recv() => input,
            Some(question) = world.questions.recv() => {
                answer(&brain, question);
                continue;
            }
        };
        let second_passed = matches!(input, Input::Usage(_));
        // Once a second, and whenever routes change: samples name the robot that minted
        // their epoch only by a hash.
        let mut robots_due = second_passed;
        brain.handle(clock::now(), input);
        while let Some(effect) = brain.poll_effect() {
            robots_due |= matches!(effect, Effect::Routes(_));
            world.effects.carry_out(effect);
        }
        if robots_due {
            world.name_robots(&brain);
        }
        if second_passed {
            world.mesh_watch.look(brain.mesh_counters());
        }
    }
}

fn answer(brain: &Brain, question: Question) {
    // Whoever asked may have gone.
    match question {
        Question::Status(asker) => drop(asker.send(brain.status(clock::now()))),
        Question::Mesh(asker) => drop(asker.send(brain.mesh_counters())),
    }
}
