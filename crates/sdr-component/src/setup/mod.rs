//! Declaring ports, parameters and devices: one declaration serves `--describe` and the run.

mod error;
mod parameter;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use sdr_core::{
    id::Name,
    spec::{ComponentProfile, DeviceProfile, ParameterProfile, PortProfile, Value, port_path},
};

pub use error::SetupError;
pub use parameter::Parameter;

use crate::{
    component::Component,
    message::Message,
    port::{Connection, InPort, InputCore, OutPort, OutputCore, SharedInput, SharedOutput},
    protocol::{BALLAST_BYTES_MAX, BALLAST_PARAMETER, Configure},
    shm::Memory,
};

/// Given to [`Component::new`]: declares what the component has, and hands it out.
#[derive(Debug)]
pub struct Setup {
    profile: ComponentProfile,
    /// Absent while the component only describes itself.
    wiring: Option<Wiring>,
    pub(crate) inputs: Vec<SharedInput>,
    pub(crate) outputs: Vec<SharedOutput>,
}

/// What a real run adds to a declaration.
#[derive(Debug, Clone)]
pub(crate) struct Wiring {
    pub(crate) configure: Arc<Configure>,
    pub(crate) memory: Arc<Memory>,
}

impl Setup {
    pub(crate) fn new<C: Component>(wiring: Option<Wiring>) -> Self {
        let profile = ComponentProfile {
            name: C::NAME.to_owned(),
            about: C::ABOUT.to_owned(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            parameters: Vec::new(),
            devices: Vec::new(),
        };
        Self { profile, wiring, inputs: Vec::new(), outputs: Vec::new() }
    }

    /// Declares an input that carries messages of type `M`.
    pub fn input<M: Message>(&mut self, name: &str) -> Result<InPort<M>, SetupError> {
        let name = Name::new(name)?;
        declare(&mut self.profile.inputs, &name, M::TYPE, 0)?;
        let connections = match &self.wiring {
            None => Vec::new(),
            Some(wiring) => wiring.connections::<M>(&name)?,
        };
        let shared = SharedInput::new(InputCore::new::<M>(connections));
        self.inputs.push(shared.clone());
        Ok(InPort::new(shared))
    }

    /// Declares an output that carries messages of type `M`, usually small ones.
    pub fn output<M: Message>(&mut self, name: &str) -> Result<OutPort<M>, SetupError> {
        self.output_of_size(name, 1024)
    }

    /// Declares an output whose samples usually have at most `size_hint_bytes`; larger ones
    /// take a moment longer, once.
    pub fn output_of_size<M: Message>(
        &mut self,
        name: &str,
        size_hint_bytes: u32,
    ) -> Result<OutPort<M>, SetupError> {
        let name = Name::new(name)?;
        declare(&mut self.profile.outputs, &name, M::TYPE, size_hint_bytes)?;
        let publisher = match &self.wiring {
            None => None,
            Some(Wiring { configure, memory }) => {
                let path = port_path(&configure.component, &name);
                let size = usize::try_from(size_hint_bytes).unwrap_or(usize::MAX);
                Some(memory.publisher(&path, configure.output_depth, size)?)
            }
        };
        let shared = SharedOutput::new(OutputCore::new(name, publisher));
        self.outputs.push(shared.clone());
        Ok(OutPort::new(shared))
    }

    /// Declares a parameter and returns its value: the configured one, or the default.
    ///
    /// `about` says what it means, with its unit.
    pub fn parameter<P: Parameter>(
        &mut self,
        name: &str,
        default: P,
        about: &str,
    ) -> Result<P, SetupError> {
        if self.profile.parameters.iter().any(|known| known.name == name) {
            return Err(SetupError::DeclaredTwice { what: "parameter", name: name.to_owned() });
        }
        let default_value = default.to_value();
        let allowed = default_value.kind();
        self.profile.parameters.push(ParameterProfile {
            name: name.to_owned(),
            about: about.to_owned(),
            default: default_value,
            min: None,
            max: None,
        });
        match self.configured(name) {
            None => Ok(default),
            Some(value) => P::from_value(value).ok_or_else(|| SetupError::ParameterKind {
                name: name.to_owned(),
                found: value.clone(),
                kind: value.kind(),
                allowed,
            }),
        }
    }

    /// As [`Setup::parameter`], refusing values outside `allowed`; the range is told before
    /// anything is deployed.
    pub fn parameter_within<P>(
        &mut self,
        name: &str,
        default: P,
        allowed: std::ops::RangeInclusive<P>,
        about: &str,
    ) -> Result<P, SetupError>
    where
        P: Parameter + PartialOrd + std::fmt::Display,
    {
        let value = self.parameter(name, default, about)?;
        if let Some(declared) = self.profile.parameters.last_mut() {
            declared.min = Some(allowed.start().to_value());
            declared.max = Some(allowed.end().to_value());
        }
        if allowed.contains(&value) {
            return Ok(value);
        }
        Err(SetupError::ParameterRange {
            name: name.to_owned(),
            found: value.to_string(),
            from: allowed.start().to_string(),
            to: allowed.end().to_string(),
        })
    }

    /// Declares that a device of the robot is needed, and tells where it is. Empty while the
    /// component only describes itself.
    pub fn device(&mut self, name: &str) -> Result<PathBuf, SetupError> {
        self.need(DeviceProfile { name: name.to_owned(), unless: None })
    }

    /// As [`Setup::device`] for one that is not needed where `parameter` has a value other than
    /// its default; ask for it only where it has not.
    pub fn device_unless(&mut self, name: &str, parameter: &str) -> Result<PathBuf, SetupError> {
        self.need(DeviceProfile { name: name.to_owned(), unless: Some(parameter.to_owned()) })
    }

    fn need(&mut self, device: DeviceProfile) -> Result<PathBuf, SetupError> {
        let name = device.name.clone();
        self.profile.devices.push(device);
        match &self.wiring {
            None => Ok(PathBuf::new()),
            Some(wiring) => match wiring.configure.devices.get(&name) {
                Some(place) => Ok(PathBuf::from(place)),
                None => {
                    Err(SetupError::NoDevice { name, known: join(wiring.configure.devices.keys()) })
                }
            },
        }
    }

    /// What was declared; the ballast that every component has stands last.
    pub(crate) fn profile(&self) -> ComponentProfile {
        let mut profile = self.profile.clone();
        profile.parameters.push(ParameterProfile {
            name: BALLAST_PARAMETER.to_owned(),
            about: "bytes to hold and touch from start to end, a test aid; 0 is none".to_owned(),
            default: Value::Int(0),
            min: Some(Value::Int(0)),
            max: Some(Value::Int(BALLAST_BYTES_MAX)),
        });
        profile
    }

    /// Refuses what was configured and never declared.
    pub(crate) fn check_complete(&self) -> Result<(), SetupError> {
        let Some(Wiring { configure, .. }) = &self.wiring else { return Ok(()) };
        check_known(&self.profile(), &configure.parameters)?;
        for wired in &configure.inputs {
            if !self.profile.inputs.iter().any(|port| port.name == wired.port) {
                return Err(SetupError::UnknownInput {
                    name: wired.port.to_string(),
                    known: join(self.profile.inputs.iter().map(|port| &port.name)),
                });
            }
        }
        Ok(())
    }

    fn configured(&self, name: &str) -> Option<&Value> {
        self.wiring.as_ref()?.configure.parameters.get(name)
    }
}

impl Wiring {
    fn connections<M: Message>(&self, port: &Name) -> Result<Vec<Connection>, SetupError> {
        let wired = self.configure.inputs.iter().filter(|wired| wired.port == *port);
        wired
            .map(|wired| {
                if wired.message_type != M::TYPE {
                    return Err(SetupError::WrongType {
                        port: port.to_string(),
                        path: wired.path.clone(),
                        found: wired.message_type.clone(),
                        allowed: M::TYPE,
                    });
                }
                let subscriber = self.memory.subscriber(&wired.path, wired.qos.depth)?;
                Ok(Connection::new(wired.clone(), subscriber))
            })
            .collect()
    }
}

fn declare(
    ports: &mut Vec<PortProfile>,
    name: &Name,
    message_type: &str,
    size_hint_bytes: u32,
) -> Result<(), SetupError> {
    if ports.iter().any(|port| port.name == *name) {
        return Err(SetupError::DeclaredTwice { what: "port", name: name.to_string() });
    }
    let message_type = message_type.to_owned();
    ports.push(PortProfile { name: name.clone(), message_type, size_hint_bytes });
    Ok(())
}

/// Refuses values whose name the profile does not know, or whose kind is another.
pub(crate) fn check_known(
    profile: &ComponentProfile,
    values: &BTreeMap<String, Value>,
) -> Result<(), SetupError> {
    for (name, value) in values {
        let Some(known) = profile.parameters.iter().find(|known| known.name == *name) else {
            return Err(SetupError::UnknownParameter {
                name: name.clone(),
                known: join(profile.parameters.iter().map(|known| &known.name)),
            });
        };
        let is_number = known.default.as_f64().is_some() && value.as_f64().is_some();
        let is_narrowed = matches!((&known.default, value), (Value::Int(_), Value::Float(_)));
        if value.kind() != known.default.kind() && (!is_number || is_narrowed) {
            return Err(SetupError::ParameterKind {
                name: name.clone(),
                found: value.clone(),
                kind: value.kind(),
                allowed: known.default.kind(),
            });
        }
    }
    Ok(())
}

fn join<T: ToString>(names: impl Iterator<Item = T>) -> String {
    let names: Vec<String> = names.map(|name| name.to_string()).collect();
    if names.is_empty() { String::from("none") } else { names.join(", ") }
}

#[cfg(test)]
mod tests;
