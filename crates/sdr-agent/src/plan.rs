//! Carries out [`sdr_core::effect::Effect::Plan`] off the loop.

use std::sync::PoisonError;

use sdr_core::{
    allocate::{Plan, Problem},
    api::PlanView,
    input::{Input, PlanId},
};
use tokio::sync::mpsc;

use crate::api::LatestPlan;

/// Asks the allocator on a thread of its own and hands the answer in.
pub(crate) fn carry_out(
    plan: PlanId,
    problem: Box<Problem>,
    latest: LatestPlan,
    inputs: mpsc::Sender<Input>,
) {
    tokio::task::spawn_blocking(move || {
        let result = sdr_alloc::allocate(&problem);
        if let Ok(found) = &result {
            *latest.lock().unwrap_or_else(PoisonError::into_inner) = view(&problem, found);
        }
        // Nobody is left to hear it when the agent stops.
        let _ = inputs.blocking_send(Input::Planned { plan, result });
    });
}

fn view(problem: &Problem, plan: &Plan) -> PlanView {
    let system = problem.items.first().map(|item| item.component.system.to_string());
    PlanView {
        system: system.unwrap_or_default(),
        allocator: plan.allocator.clone(),
        placements: plan.placements.clone(),
        homeless: plan.homeless.clone(),
    }
}
