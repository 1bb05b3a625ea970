//! Reading values: one pass, a bounded depth, nothing kept twice.

use alloc::{borrow::ToOwned as _, string::String, vec::Vec};
use core::fmt;

use serde::{
    Deserialize, Deserializer,
    de::{self, DeserializeSeed, EnumAccess, SeqAccess, VariantAccess, Visitor},
};

use super::{LISTS_DEEP_MAX, Value};

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Room(LISTS_DEEP_MAX).deserialize(deserializer)
    }
}

/// How many lists may still stand in each other.
#[derive(Clone, Copy)]
struct Room(usize);

impl<'de> DeserializeSeed<'de> for Room {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        const KINDS: &[&str] = &["Bool", "Int", "Float", "Text", "List"];
        if deserializer.is_human_readable() {
            deserializer.deserialize_any(Bare(self))
        } else {
            deserializer.deserialize_enum("Value", KINDS, Tagged(self))
        }
    }
}

/// The items of a list.
struct Items(Room);

impl Items {
    /// The items of a list that stands in `room`.
    fn below<E: de::Error>(room: Room) -> Result<Self, E> {
        let inner = room.0.checked_sub(1);
        let too_deep = || {
            let said = alloc::format!("lists stand deeper in each other than {LISTS_DEEP_MAX}");
            E::custom(said)
        };
        inner.map(|inner| Self(Room(inner))).ok_or_else(too_deep)
    }
}

impl<'de> DeserializeSeed<'de> for Items {
    type Value = Vec<Value>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Vec<Value>, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Items {
    type Value = Vec<Value>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<Value>, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = list.next_element_seed(self.0)? {
            items.push(item);
        }
        Ok(items)
    }
}

/// As people write it: no tags.
struct Bare(Room);

impl<'de> Visitor<'de> for Bare {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("true or false, a number, text or a list")
    }

    fn visit_bool<E: de::Error>(self, flag: bool) -> Result<Value, E> {
        Ok(Value::Bool(flag))
    }

    fn visit_i64<E: de::Error>(self, whole: i64) -> Result<Value, E> {
        Ok(Value::Int(whole))
    }

    #[expect(clippy::cast_precision_loss, reason = "beyond 63 bits it is no count")]
    fn visit_u64<E: de::Error>(self, whole: u64) -> Result<Value, E> {
        Ok(i64::try_from(whole).map_or(Value::Float(whole as f64), Value::Int))
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<Value, E> {
        Ok(Value::Float(number))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Value, E> {
        Ok(Value::Text(text.to_owned()))
    }

    fn visit_string<E: de::Error>(self, text: String) -> Result<Value, E> {
        Ok(Value::Text(text))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Value, A::Error> {
        Items::below(self.0)?.visit_seq(list).map(Value::List)
    }
}

/// As the mesh carries it: the kind, then the value.
struct Tagged(Room);

/// The kinds, by their number on the wire.
#[derive(Deserialize)]
enum Kind {
    Bool,
    Int,
    Float,
    Text,
    List,
}

impl<'de> Visitor<'de> for Tagged {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value with its kind")
    }

    fn visit_enum<A: EnumAccess<'de>>(self, tagged: A) -> Result<Value, A::Error> {
        let (kind, value) = tagged.variant()?;
        match kind {
            Kind::Bool => value.newtype_variant().map(Value::Bool),
            Kind::Int => value.newtype_variant().map(Value::Int),
            Kind::Float => value.newtype_variant().map(Value::Float),
            Kind::Text => value.newtype_variant().map(Value::Text),
            Kind::List => value.newtype_variant_seed(Items::below(self.0)?).map(Value::List),
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::{format, string::ToString as _, vec};

    use super::*;

    fn nested(depth: usize) -> Value {
        (0..depth).fold(Value::Int(7), |inner, _| Value::List(vec![inner]))
    }

    #[test]
    fn every_kind_is_read_back_from_the_mesh_and_from_text() {
        let items = [
            Value::Bool(true),
            Value::Int(-3),
            Value::Float(0.5),
            Value::Text("word".into()),
            nested(LISTS_DEEP_MAX - 1),
        ];
        let value = Value::List(items.into());

        let bytes = postcard::to_allocvec(&value).unwrap();
        assert_eq!(postcard::from_bytes::<Value>(&bytes), Ok(value.clone()));
        let text = serde_json::to_string(&value).unwrap();
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
        assert_eq!(
            serde_json::from_str::<Value>("18446744073709551615").unwrap().as_f64(),
            Some(1.8446744073709552e19)
        );
    }

    #[test]
    fn lists_deeper_than_allowed_are_refused_from_the_mesh_and_from_text() {
        for depth in [LISTS_DEEP_MAX + 1, 500] {
            let value = nested(depth);
            let bytes = postcard::to_allocvec(&value).unwrap();
            assert!(postcard::from_bytes::<Value>(&bytes).is_err(), "{depth}");
        }
        let text = format!("{}{}", "[".repeat(LISTS_DEEP_MAX + 1), "]".repeat(LISTS_DEEP_MAX + 1));
        let refused = serde_json::from_str::<Value>(&text).unwrap_err().to_string();
        assert!(refused.contains("deeper in each other than 16"), "{refused}");
    }

    #[test]
    fn a_kind_of_a_later_version_is_refused() {
        assert!(postcard::from_bytes::<Value>(&[5, 0]).is_err());
        assert!(serde_json::from_str::<Value>("null").is_err());
        assert!(serde_json::from_str::<Value>("{\"a\": 1}").is_err());
    }
}
