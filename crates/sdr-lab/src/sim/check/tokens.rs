//! The tokens that one consumer accepts never decrease, and no two activations share one.

use std::collections::BTreeMap;

use sdr_core::{input::InstanceId, order::Token};

use crate::sim::{Broken, Checker, Fleet, Sight};

/// `token-decreased`, `token-reused`.
#[derive(Debug, Default)]
pub struct Tokens {
    /// By robot, process and connection.
    accepted: BTreeMap<(usize, InstanceId, u16), Token>,
    /// Which process was active under a token: robot, start of its agent, process.
    used: BTreeMap<(usize, Token), (usize, u64, InstanceId)>,
}

impl Checker for Tokens {
    fn watch(&mut self, fleet: &Fleet, sight: &Sight) -> Option<Broken> {
        if let Sight::Off { robot } = sight {
            self.accepted.retain(|(of, ..), _| of != robot);
            if fleet.remembers_nothing() {
                self.used.clear();
            }
        }
        if let Sight::Accepted { robot, instance, connection, token } = sight {
            let before = self.accepted.insert((*robot, *instance, *connection), token.clone())?;
            let what = format!("connection {connection}: {token} after {before}");
            return (before > *token).then(|| Broken::new("token-decreased", what));
        }
        let Sight::Active { robot, instance, component, token } = sight else { return None };
        let me = (*robot, fleet.robots[*robot].life(), *instance);
        let before = self.used.insert((*component, token.clone()), me)?;
        (before != me).then(|| {
            let what = format!(
                "{} is active under {token} on robot-{}, as it was on robot-{}",
                fleet.key(*component),
                robot + 1,
                before.0 + 1
            );
            Broken::new("token-reused", what)
        })
    }
}
