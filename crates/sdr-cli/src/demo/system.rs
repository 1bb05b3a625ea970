//! The paper's system, built in, with what this run adds to it.

use std::{fmt::Display, path::Path};

use sdr_core::{
    recover::Cause,
    spec::{ComponentProfile, SystemSpec, Value},
};
use sdr_files::{LoadedSystem, link_profiles, parse_system};
use sdr_recovery::{Level, Trigger};
use serde::Deserialize;

use crate::{failure::Failure, report::extra::Bars};

/// The same text as the repository's file; its policies are built into the file reader.
const TEXT: &str = include_str!("../../../../systems/exploration.yaml");
const FILE: &str = "systems/exploration.yaml (built in)";
/// The parameter of every component that makes it allocate and touch memory.
const BALLAST: &str = "ballast_bytes";
/// The parameter of components that can replay pictures.
const IMAGES: &str = "images";
/// What the paper's components allocate.
const BALLAST_BYTES: i64 = 500_000_000;

/// `GET /v1/components`.
#[derive(Debug, Deserialize)]
pub(super) struct Available {
    /// What the robot can launch.
    pub(super) components: Vec<ComponentProfile>,
}

/// The system to deploy; `folder` is where it looks for policies before the built-in ones.
pub(super) fn make(
    profiles: &[ComponentProfile],
    folder: &Path,
    ballast: bool,
    images: Option<&Path>,
) -> Result<SystemSpec, Failure> {
    let mut loaded = load(folder)?;
    link_profiles(&mut loaded, profiles).map_err(|problems| {
        Failure::new(format!(
            "the components beside sdr do not fit its system; build them together\n{problems}"
        ))
    })?;
    let mut spec = loaded.spec;
    if ballast {
        for component in &mut spec.components {
            component.parameters.push((BALLAST.to_owned(), Value::Int(BALLAST_BYTES)));
        }
    }
    if let Some(folder) = images {
        replay(&mut spec, profiles, folder)?;
    }
    Ok(spec)
}

/// The programs it is made of.
pub(super) fn executables(folder: &Path) -> Result<Vec<String>, Failure> {
    let components = load(folder)?.spec.components;
    Ok(components.iter().map(|component| component.launch.name().to_owned()).collect())
}

/// The bars of its policies.
pub(super) fn bars(folder: &Path) -> Result<Bars, Failure> {
    let spec = load(folder)?.spec;
    let unread = |error: &dyn Display| Failure::new(format!("{FILE}: {error}"));
    let allocation = sdr_alloc::Policy::decode(&spec.allocation).map_err(|error| unread(&error))?;
    let recovery = sdr_recovery::Policy::decode(&spec.recovery).map_err(|error| unread(&error))?;
    let memory = |bars: &sdr_alloc::Bars| bars.memory_free_at_least.map(|bytes| bytes.0);
    let mut bars = Bars {
        allocation_memory_bytes: memory(&allocation.strict),
        relaxed_memory_bytes: allocation.relaxed.as_ref().and_then(memory),
        ..Bars::default()
    };
    for rule in &recovery.parts().rules {
        let Trigger::Condition(condition) = rule.trigger else { continue };
        let level = condition.bar.level();
        if let (Cause::MemoryShort, Level::Memory(bytes)) = (rule.cause, level) {
            bars.recovery_memory_bytes = Some(bytes.0);
        }
        if let (Cause::RssiLow, Level::Signal(level)) = (rule.cause, level) {
            bars.recovery_rssi_dbm = Some(level.as_f64());
            bars.recovery_rssi_hold_s = Some(condition.hold.as_secs_f64());
        }
    }
    Ok(bars)
}

fn load(folder: &Path) -> Result<LoadedSystem, Failure> {
    parse_system(FILE, TEXT, folder).map_err(|problems| Failure::new(problems.to_string()))
}

/// Has every component that can do so replay the pictures of `folder`.
fn replay(
    spec: &mut SystemSpec,
    profiles: &[ComponentProfile],
    folder: &Path,
) -> Result<(), Failure> {
    let Some(text) = folder.to_str() else {
        let folder = folder.display();
        return Err(Failure::Usage(format!("--images {folder}: the path is no UTF-8")));
    };
    let can = |name: &str| {
        let profile = profiles.iter().find(|profile| profile.name == name);
        profile.is_some_and(|found| found.parameters.iter().any(|one| one.name == IMAGES))
    };
    let mut count = 0;
    for component in spec.components.iter_mut().filter(|one| can(one.launch.name())) {
        component.parameters.push((IMAGES.to_owned(), Value::Text(text.to_owned())));
        count += 1;
    }
    match count {
        0 => {
            Err(Failure::new("no component beside sdr has a parameter `images`; build them again"))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use sdr_core::spec::{ParameterProfile, PortProfile};

    use super::*;

    fn profile(
        name: &str,
        inputs: &[&str],
        outputs: &[&str],
        parameters: &[&str],
    ) -> ComponentProfile {
        let port = |port: &&str| PortProfile {
            name: port.parse().unwrap(),
            message_type: format!("sdr_msgs/msg/Of{port}"),
            size_hint_bytes: 0,
        };
        let parameter = |name: &&str| ParameterProfile {
            name: (*name).to_owned(),
            about: String::new(),
            default: Value::Text(String::new()),
            min: None,
            max: None,
        };
        ComponentProfile {
            name: name.to_owned(),
            about: String::new(),
            inputs: inputs.iter().map(port).collect(),
            outputs: outputs.iter().map(port).collect(),
            parameters: parameters.iter().map(parameter).collect(),
            devices: Vec::new(),
        }
    }

    fn profiles() -> Vec<ComponentProfile> {
        vec![
            profile("fisheye", &[], &["image"], &["images"]),
            profile("anomaly", &["image"], &["danger"], &[]),
            profile("camera", &[], &["image"], &["images"]),
            profile("controller", &["danger", "odometry"], &["wheels"], &[]),
            profile("position", &["image", "wheels"], &["odometry"], &[]),
        ]
    }

    fn of(spec: &SystemSpec, component: usize, name: &str) -> Option<Value> {
        let parameters = &spec.components[component].parameters;
        parameters.iter().find(|one| one.0 == name).map(|one| one.1.clone())
    }

    #[test]
    fn ballast_goes_to_every_component_and_only_when_wanted() {
        let folder = tempfile::tempdir().unwrap();
        let with = make(&profiles(), folder.path(), true, None).unwrap();
        let without = make(&profiles(), folder.path(), false, None).unwrap();
        for component in 0..5 {
            assert_eq!(of(&with, component, BALLAST), Some(Value::Int(500_000_000)));
            assert_eq!(of(&without, component, BALLAST), None);
        }
        assert_eq!(with.allocation.name, "exploration");
        assert_eq!(with.connections[0].message_type, "sdr_msgs/msg/Ofimage");
    }

    #[test]
    fn bars_are_those_of_the_policies_that_are_deployed() {
        let folder = tempfile::tempdir().unwrap();
        let built_in = Bars {
            allocation_memory_bytes: Some(500_000_000),
            relaxed_memory_bytes: Some(250_000_000),
            recovery_memory_bytes: Some(200_000_000),
            recovery_rssi_dbm: Some(-52.5),
            recovery_rssi_hold_s: Some(6.0),
        };
        assert_eq!(bars(folder.path()).unwrap(), built_in);

        let own = folder.path().join("policies/recovery");
        std::fs::create_dir_all(&own).unwrap();
        let text = include_str!("../../../../policies/recovery/exploration.yaml");
        let edited = text.replace("-52.5dBm, for: 6s", "-60dBm, for: 9s");
        std::fs::write(own.join("exploration.yaml"), edited).unwrap();
        let found = bars(folder.path()).unwrap();
        assert_eq!((found.recovery_rssi_dbm, found.recovery_rssi_hold_s), (Some(-60.0), Some(9.0)));
    }

    #[test]
    fn pictures_go_to_the_cameras_alone() {
        let folder = tempfile::tempdir().unwrap();
        let spec = make(&profiles(), folder.path(), false, Some(Path::new("/p"))).unwrap();
        let found: Vec<bool> = (0..5).map(|one| of(&spec, one, IMAGES).is_some()).collect();
        assert_eq!(found, [true, false, true, false, false]);
    }

    #[test]
    fn components_of_another_build_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        match make(&profiles()[1..], folder.path(), true, None) {
            Err(Failure::Failed(answer)) => assert!(answer.error.contains("fisheye"), "{answer:?}"),
            other => panic!("{other:?}"),
        }
    }
}
