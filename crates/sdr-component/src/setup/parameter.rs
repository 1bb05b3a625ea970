//! Kinds of parameters.

use sdr_core::spec::Value;

/// A Rust type that a parameter can have.
pub trait Parameter: Sized {
    /// From a configured value; `None` when it is of another kind.
    fn from_value(value: &Value) -> Option<Self>;

    /// As a value, for the profile.
    fn to_value(&self) -> Value;
}

impl Parameter for Value {
    fn from_value(value: &Value) -> Option<Self> {
        Some(value.clone())
    }

    fn to_value(&self) -> Value {
        self.clone()
    }
}

impl Parameter for bool {
    fn from_value(value: &Value) -> Option<Self> {
        if let Value::Bool(flag) = value { Some(*flag) } else { None }
    }

    fn to_value(&self) -> Value {
        Value::Bool(*self)
    }
}

impl Parameter for i64 {
    fn from_value(value: &Value) -> Option<Self> {
        if let Value::Int(whole) = value { Some(*whole) } else { None }
    }

    fn to_value(&self) -> Value {
        Value::Int(*self)
    }
}

impl Parameter for f64 {
    /// Whole numbers are numbers too; what is not finite is none.
    fn from_value(value: &Value) -> Option<Self> {
        value.as_f64().filter(|number| number.is_finite())
    }

    fn to_value(&self) -> Value {
        Value::Float(*self)
    }
}

impl Parameter for String {
    fn from_value(value: &Value) -> Option<Self> {
        if let Value::Text(text) = value { Some(text.clone()) } else { None }
    }

    fn to_value(&self) -> Value {
        Value::Text(self.clone())
    }
}

impl<P: Parameter> Parameter for Vec<P> {
    fn from_value(value: &Value) -> Option<Self> {
        let Value::List(items) = value else { return None };
        items.iter().map(P::from_value).collect()
    }

    fn to_value(&self) -> Value {
        Value::List(self.iter().map(P::to_value).collect())
    }
}
