//! One match: each effect to its driver. Nothing here waits for anybody.

use sdr_core::{effect::Effect, input::Input};
use tokio::sync::mpsc;

use crate::api::{AnswerDesk, LatestPlan};
use crate::blobs::Parts;
use crate::data::Data;
use crate::events::Events;
use crate::mesh::udp::Mesh;
use crate::plan;
use crate::programs::Programs;
use crate::store::Store;
use crate::supervisor::Supervisor;

/// All drivers that take orders.
#[derive(Debug)]
pub(crate) struct Effects {
    pub(crate) mesh: Mesh,
    pub(crate) store: Store,
    pub(crate) parts: Parts,
    pub(crate) supervisor: Supervisor,
    pub(crate) data: Data,
    pub(crate) desk: AnswerDesk,
    pub(crate) events: Events,
    pub(crate) plan: LatestPlan,
    pub(crate) programs: Programs,
    /// For what comes of a plan.
    pub(crate) inputs: mpsc::Sender<Input>,
}

impl Effects {
    /// Hands an order over; what comes of it is an input.
    pub(crate) fn carry_out(&self, effect: Effect) {
        match effect {
            Effect::Send { to, bytes } => self.mesh.send(to, &bytes),
            Effect::Store { ticket, change } => self.store.put(ticket, change),
            Effect::Fetch { blob, from } => self.parts.fetch(blob, from),
            Effect::Launch(order) => self.supervisor.launch(*order),
            Effect::Command { instance, command } => self.supervisor.command(instance, command),
            Effect::Routes(routes) => self.data.set_routes(routes),
            Effect::Plan { plan, problem } => {
                plan::carry_out(plan, problem, self.plan.clone(), self.inputs.clone());
            }
            Effect::Ask(order) => self.programs.ask(*order),
            Effect::Answer { request, result } => self.desk.answer(request, result),
            Effect::Event(event) => self.events.publish(event),
        }
    }
}
