//! Bodies and paths of the API, as far as the brain: what passes the checks is deployed.
#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use sdr_core::{
    api::{DeployRequest, RoleMoveRequest, RolePolicyRequest},
    id::{Name, RobotId},
    input::Input,
};
use sdr_fuzz::{bytes::Choices, meter, shell::Shell};
use sdr_keys::Delivery;

/// Memory that reading a body may take: as much again as it has, some times.
fn allowed(body: &[u8]) -> usize {
    256 * 1024 + 64 * body.len()
}

fn tell(input: Input) {
    let mut shell = Shell::settled();
    shell.tell(input);
    shell.pass(Duration::from_secs(3));
    assert_eq!(shell.answers, 1, "one answer for one request");
}

fuzz_target!(|bytes: &[u8]| {
    let mut choices = Choices(bytes);
    let kind = choices.byte();
    let body = choices.rest();
    match kind % 5 {
        0 => {
            let read = || {
                let request = serde_json::from_slice::<DeployRequest>(body).ok()?;
                request.system.check().is_ok().then_some(request)
            };
            let Some(request) = meter::at_most(allowed(body), read) else { return };
            let again = serde_json::to_vec(&request).expect("what was read can be written");
            let again: DeployRequest = serde_json::from_slice(&again).expect("and read again");
            assert_eq!(again, request);
            tell(Input::Deploy { request: 1, system: request.system });
        }
        1 => {
            let Ok(request) = serde_json::from_slice::<RoleMoveRequest>(body) else { return };
            tell(Input::MoveRole { request: 1, to: request.to });
        }
        2 => {
            let read = || serde_json::from_slice::<RolePolicyRequest>(body);
            let Ok(request) = meter::at_most(allowed(body), read) else { return };
            tell(Input::RolePolicy { request: 1, policy: Box::new(request.policy) });
        }
        3 => drop(meter::at_most(allowed(body), || serde_json::from_slice::<Delivery>(body))),
        _ => {
            let word = String::from_utf8_lossy(body);
            if let Ok(name) = Name::new(&word) {
                assert_eq!(name.as_str(), word);
                tell(Input::Undeploy { request: 1, system: name });
            }
            if let Ok(robot) = RobotId::new(&word) {
                assert_eq!(robot.as_str(), word);
            }
        }
    }
});
