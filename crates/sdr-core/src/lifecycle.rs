//! The life cycle of a component, after OMG RTC 1.1 (Created, Inactive, Active, Error).
//!
//! ```text
//!              initialize            activate
//!   Created ───────────────▶ Inactive ◀──────▶ Active
//!                              ▲    deactivate    │ error
//!                        reset │                  ▼
//!                              └─────────────── Error ──▶ (on_error each tick)
//!   finalize from Inactive or Error, and from Created ──▶ Finalized
//! ```

use core::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Where a component stands in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LifecycleState {
    /// The process runs, nothing was called yet.
    Created,
    /// Initialised, not executing.
    Inactive,
    /// `on_execute` is called.
    Active,
    /// Something went wrong; waits for a reset or the end.
    Error,
    /// `on_finalize` was called; the process ends.
    Finalized,
}

impl fmt::Display for LifecycleState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Created => "created",
            Self::Inactive => "inactive",
            Self::Active => "active",
            Self::Error => "error",
            Self::Finalized => "finalized",
        })
    }
}

/// A wish to change the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transition {
    /// Created -> Inactive.
    Initialize,
    /// Inactive -> Active.
    Activate,
    /// Active -> Inactive.
    Deactivate,
    /// Active -> Error (a callback failed, or the component said so). From Inactive too,
    /// when activation failed.
    Fail,
    /// Error -> Inactive.
    Reset,
    /// Created, Inactive or Error -> Finalized.
    Finalize,
}

/// What the component's author filled in, named as in OMG RTC 1.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Callback {
    /// Once, before anything else.
    OnInitialize,
    /// On entering Active.
    OnActivated,
    /// Each tick while Active.
    OnExecute,
    /// On leaving Active as told.
    OnDeactivated,
    /// On leaving Active because something failed.
    OnAborting,
    /// Each tick while in Error.
    OnError,
    /// On the way from Error to Inactive.
    OnReset,
    /// The rate of the execution context changed.
    OnRateChanged,
    /// Once, at the end.
    OnFinalize,
}

/// A transition that the present state does not know. Nothing changed; the caller erred.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("cannot {transition:?} while {state}")]
pub struct TransitionError {
    /// The state that stays.
    pub state: LifecycleState,
    /// What was asked for.
    pub transition: Transition,
}

/// The life cycle as a state machine: `check` a transition, run the callback owed, `commit`.
#[derive(Clone, Debug)]
pub struct Lifecycle {
    state: LifecycleState,
}

impl Default for Lifecycle {
    fn default() -> Self {
        Self { state: LifecycleState::Created }
    }
}

impl Lifecycle {
    /// The present state.
    pub fn state(&self) -> LifecycleState {
        self.state
    }

    /// Takes `transition` when it is legal and returns the callback owed for it.
    ///
    /// A transition into the state that is already there (activate while Active) is no
    /// error and owes nothing: commands may be repeated.
    pub fn take(&mut self, transition: Transition) -> Result<Option<Callback>, TransitionError> {
        let (next, callback) = step(self.state, transition)
            .ok_or(TransitionError { state: self.state, transition })?;
        self.state = next;
        Ok(callback)
    }

    /// The callback owed at each tick of the execution context in the present state.
    pub fn on_tick(&self) -> Option<Callback> {
        match self.state {
            LifecycleState::Active => Some(Callback::OnExecute),
            LifecycleState::Error => Some(Callback::OnError),
            LifecycleState::Created | LifecycleState::Inactive | LifecycleState::Finalized => None,
        }
    }
}

/// Next state and callback owed, or `None` when the state does not know the transition.
fn step(
    state: LifecycleState,
    transition: Transition,
) -> Option<(LifecycleState, Option<Callback>)> {
    use LifecycleState::{Active, Created, Error, Finalized, Inactive};
    let answer = match (state, transition) {
        (Created, Transition::Initialize) => (Inactive, Some(Callback::OnInitialize)),
        (Inactive, Transition::Activate) => (Active, Some(Callback::OnActivated)),
        (Active, Transition::Deactivate) => (Inactive, Some(Callback::OnDeactivated)),
        (Active, Transition::Fail) => (Error, Some(Callback::OnAborting)),
        (Inactive, Transition::Fail) => (Error, None),
        (Error, Transition::Reset) => (Inactive, Some(Callback::OnReset)),
        (Created | Inactive | Error, Transition::Finalize) => {
            (Finalized, Some(Callback::OnFinalize))
        }
        (Inactive, Transition::Initialize | Transition::Deactivate | Transition::Reset)
        | (Active, Transition::Activate)
        | (Error, Transition::Fail)
        | (Finalized, Transition::Finalize) => (state, None),
        (Created | Active | Error | Finalized, _) => return None,
    };
    Some(answer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_life_owes_each_callback_once() {
        let mut life = Lifecycle::default();
        let story = [
            (Transition::Initialize, Callback::OnInitialize),
            (Transition::Activate, Callback::OnActivated),
            (Transition::Fail, Callback::OnAborting),
            (Transition::Reset, Callback::OnReset),
            (Transition::Activate, Callback::OnActivated),
            (Transition::Deactivate, Callback::OnDeactivated),
            (Transition::Finalize, Callback::OnFinalize),
        ];
        for (transition, owed) in story {
            assert_eq!(life.take(transition), Ok(Some(owed)));
        }
        assert_eq!(life.state(), LifecycleState::Finalized);
    }

    #[test]
    fn a_repeated_command_is_harmless_and_owes_nothing() {
        let mut life = Lifecycle::default();
        life.take(Transition::Initialize).unwrap();
        life.take(Transition::Activate).unwrap();
        assert_eq!(life.take(Transition::Activate), Ok(None));
        assert_eq!(life.state(), LifecycleState::Active);
    }

    #[test]
    fn what_the_standard_does_not_draw_is_refused_and_changes_nothing() {
        let mut life = Lifecycle::default();
        assert!(life.take(Transition::Activate).is_err());
        life.take(Transition::Initialize).unwrap();
        life.take(Transition::Activate).unwrap();
        assert!(life.take(Transition::Finalize).is_err());
        assert!(life.take(Transition::Reset).is_err());
        assert_eq!(life.state(), LifecycleState::Active);
    }

    #[test]
    fn only_active_and_error_are_ticked() {
        let mut life = Lifecycle::default();
        assert_eq!(life.on_tick(), None);
        life.take(Transition::Initialize).unwrap();
        assert_eq!(life.on_tick(), None);
        life.take(Transition::Activate).unwrap();
        assert_eq!(life.on_tick(), Some(Callback::OnExecute));
        life.take(Transition::Fail).unwrap();
        assert_eq!(life.on_tick(), Some(Callback::OnError));
    }
}
