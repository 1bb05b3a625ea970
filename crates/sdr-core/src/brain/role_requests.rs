//! What operators ask about the role: who holds it, and how it is chosen.

use alloc::{
    format,
    string::{String, ToString},
    vec,
    vec::Vec,
};

use super::{Brain, role::count};
use crate::{
    api::{Accepted, CandidateView, FitnessPartView, RoleAnswer, RoleView},
    effect::Effect,
    event::Event,
    fitness::RolePolicy,
    id::RobotId,
    input::RequestId,
    mesh::FleetRecord,
    order::Version,
    record::{FleetValue, RECORD_BYTES_MAX, RecordKind},
};

impl Brain {
    pub(super) fn handle_move_role(&mut self, request: RequestId, to: &RobotId) {
        if let Some(refusal) = self.objection_to_holder(to) {
            return self.refuse(request, refusal);
        }
        let answer = |term, changed| {
            Accepted::Role(RoleAnswer { holder: Some(to.to_string()), term, changed })
        };
        if self.role().is_some_and(|role| role.holder == *to && role.by_operator) {
            let result = Ok(answer(self.term(), false));
            self.effects.push_back(Effect::Answer { request, result });
            return;
        }
        let record = self.role_record(to, true);
        let term = record.version.term;
        let event = Event::new("role-moved", &self.me, format!("term {term}, to {to} by hand"));
        self.push_event(event.number("term", count(term)));
        self.mint(vec![record], Some((request, answer(term, true))));
    }

    fn objection_to_holder(&self, to: &RobotId) -> Option<String> {
        let alive = self.alive_robots();
        if !alive.contains(to) {
            let names: Vec<&str> = alive.iter().map(RobotId::as_str).collect();
            return Some(format!("{to} is not alive here; alive: [{}]", names.join(", ")));
        }
        if self.facts(to).is_none() {
            return Some(format!("{to} has not told of itself here yet; ask again"));
        }
        if !self.may_hold(to) {
            return Some(format!(
                "{to} is forbidden as coordinator, by its robot.toml or the role policy"
            ));
        }
        if self.desk.is_broken() {
            return Some(format!("{} cannot write to its disk", self.me));
        }
        self.desk.is_minting().then(|| format!("{} is busy storing; ask again", self.me))
    }

    pub(super) fn handle_role_policy(&mut self, request: RequestId, policy: RolePolicy) {
        if self.desk.is_broken() {
            return self.refuse(request, format!("{} cannot write to its disk", self.me));
        }
        let known = self.mesh.fleet().get(RecordKind::ROLE_POLICY, "");
        let revision = known.map_or(0, |(version, _)| version.revision);
        let changed = *self.role_policy() != policy || revision == 0;
        let holder = self.role().map(|role| role.holder.to_string());
        let answer = Accepted::Role(RoleAnswer { holder, term: self.term(), changed });
        if !changed {
            self.effects.push_back(Effect::Answer { request, result: Ok(answer) });
            return;
        }
        let name = policy.name.clone();
        let revision = self.number_after(RecordKind::ROLE_POLICY, "", revision);
        let value = FleetValue::RolePolicy(policy);
        let version = Version { epoch: None, revision, term: 0, author: self.me.clone() };
        let record = FleetRecord::new(RecordKind::ROLE_POLICY, String::new(), version, &value);
        if record.value.len() > RECORD_BYTES_MAX {
            let text = format!(
                "the policy takes {} bytes; at most {RECORD_BYTES_MAX} (fewer robots named)",
                record.value.len()
            );
            return self.refuse(request, text);
        }
        self.event("role-policy", format!("`{name}`, revision {revision}"));
        self.mint(vec![record], Some((request, answer)));
    }

    /// The role for people.
    pub(super) fn role_view(&self) -> RoleView {
        let said = self.succession();
        let names = |robots: &[RobotId]| robots.iter().map(ToString::to_string).collect();
        RoleView {
            holder: self.role().map(|role| role.holder.to_string()),
            term: self.term(),
            by_operator: self.role().is_some_and(|role| role.by_operator),
            suspended: self.desk_of_role.suspended,
            successors: said.map(|said| names(&said.order)).unwrap_or_default(),
            offered_to: said.and_then(|said| said.offered_to.as_ref()).map(ToString::to_string),
            reason: said.map(|said| said.reason.clone()).unwrap_or_default(),
            policy: self.role_policy().name.clone(),
            rules: self.role_policy().clone(),
            candidates: self.candidates().iter().map(|robot| self.candidate_view(robot)).collect(),
        }
    }

    fn candidate_view(&self, robot: &RobotId) -> CandidateView {
        let fitness = self.fitness(robot);
        let part = |(aspect, score, weight): (&str, u32, u16)| FitnessPartView {
            aspect: aspect.into(),
            score,
            weight,
        };
        CandidateView {
            robot: robot.to_string(),
            points: fitness.points,
            unfit: fitness.unfit,
            preferred: self.prefers(robot),
            parts: fitness.parts.into_iter().map(part).collect(),
        }
    }
}
