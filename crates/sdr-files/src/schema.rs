//! JSON schemas of the six kinds of files, from the types that they are read into.

use schemars::{JsonSchema, generate::SchemaSettings};
use serde_json::Value;

use crate::{
    policy::{AllocationFile, RecoveryFile, RoleFile},
    robot::RobotFile,
    scenario::ScenarioFile,
    system::SystemFile,
};

/// Names and texts of all schemas, as they stand in `docs/schemas/NAME.json`.
pub fn all() -> [(&'static str, String); 6] {
    [
        ("robot", text::<RobotFile>("robot.toml")),
        ("system", text::<SystemFile>("system file")),
        ("allocation", text::<AllocationFile>("allocation policy")),
        ("recovery", text::<RecoveryFile>("recovery policy")),
        ("role", text::<RoleFile>("policy of the coordinator role")),
        ("scenario", text::<ScenarioFile>("scenario of the lab")),
    ]
}

fn text<T: JsonSchema>(title: &str) -> String {
    let schema = SchemaSettings::draft2020_12().into_generator().into_root_schema_for::<T>();
    let mut value = schema.to_value();
    refuse_null(&mut value);
    if let Value::Object(object) = &mut value {
        object.insert(String::from("title"), Value::from(format!("sdr-agent: {title}")));
    }
    let text = serde_json::to_string_pretty(&value);
    format!("{}\n", text.expect("a schema is plain data"))
}

/// A key that may be missing must still say something when it is there.
fn refuse_null(value: &mut Value) {
    match value {
        Value::Object(object) => {
            if let Some(Value::Array(types)) = object.get_mut("type") {
                types.retain(|kind| kind != "null");
                if let [only] = types.as_slice() {
                    let only = only.clone();
                    object.insert(String::from("type"), only);
                }
            }
            if let Some(Value::Array(forms)) = object.get_mut("anyOf") {
                forms.retain(|form| form != &serde_json::json!({ "type": "null" }));
            }
            if let Some(Value::Array(forms)) = object.get_mut("anyOf")
                && let [Value::Object(only)] = forms.as_slice()
            {
                // One form is no choice.
                let only = only.clone();
                object.remove("anyOf");
                for (key, value) in only {
                    object.entry(key).or_insert(value);
                }
            }
            if let Some(Value::Array(words)) = object.get_mut("enum") {
                words.retain(|word| !word.is_null());
            }
            object.values_mut().for_each(refuse_null);
        }
        Value::Array(items) => items.iter_mut().for_each(refuse_null),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => {}
    }
}
