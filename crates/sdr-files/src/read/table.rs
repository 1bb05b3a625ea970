//! Tables with known keys.

use crate::{
    near::allowed_words,
    read::{Read, Reader},
    tree::{Body, Key, Node},
};

/// The keys of one table while they are read.
#[derive(Debug)]
pub(crate) struct Keys<'n> {
    node: &'n Node,
    entries: &'n [(Key, Node)],
    known: Vec<&'static str>,
}

impl<'n> Keys<'n> {
    /// The keys of `node`, when it is a table.
    pub(crate) fn of(node: &'n Node, reader: &mut Reader) -> Option<Self> {
        match &node.body {
            Body::Table(entries) => Some(Self { node, entries, known: Vec::new() }),
            Body::Nothing
            | Body::Bool(_)
            | Body::Int(_)
            | Body::Float(_)
            | Body::Text(_)
            | Body::List(_) => {
                reader.wrong(node, "a table of keys");
                None
            }
        }
    }

    /// Reads the value of `key`; a missing key that must be there is told.
    pub(crate) fn take<T: Read>(&mut self, key: &'static str, reader: &mut Reader) -> Option<T> {
        let key = key.strip_prefix("r#").unwrap_or(key);
        self.known.push(key);
        if let Some((_, node)) = self.entries.iter().find(|(other, _)| other.word == key) {
            return T::read(node, reader);
        }
        let absent = T::absent();
        if absent.is_none() {
            reader.problem(self.node.mark, format!("key `{key}` is missing"), None);
        }
        absent
    }

    /// Tells the keys that nobody knows, and those of later versions.
    pub(crate) fn finish(self, later: &[(&str, &str)], reader: &mut Reader) {
        for (key, _) in self.entries {
            if self.known.contains(&key.word.as_str()) {
                continue;
            }
            match later.iter().find(|(word, _)| *word == key.word) {
                Some((word, what)) => reader.later(key.mark, word, what),
                None => {
                    let help = allowed_words(&key.word, &self.known);
                    reader.problem(key.mark, format!("unknown key `{}`", key.word), Some(help));
                }
            }
        }
    }
}

/// Declares a table of a file: its keys are the fields, its schema is derived, and keys of
/// later versions are refused by name.
macro_rules! table {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident {
            $($(#[$field_meta:meta])* $field:ident: $type:ty,)*
        }
        $(later { $($later:ident: $what:literal,)* })?
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, schemars::JsonSchema)]
        #[schemars(deny_unknown_fields)]
        $vis struct $name {
            $($(#[$field_meta])* $vis $field: $type,)*
        }

        impl $crate::read::Read for $name {
            fn read(
                node: &$crate::tree::Node,
                reader: &mut $crate::read::Reader,
            ) -> Option<Self> {
                let mut keys = $crate::read::Keys::of(node, reader)?;
                $(let $field = keys.take::<$type>(stringify!($field), reader);)*
                keys.finish(&[$($((stringify!($later), $what)),*)?], reader);
                Some(Self { $($field: $field?,)* })
            }

            fn schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
                $crate::read::nested::<Self>(generator)
            }
        }
    };
}

/// Words for the variants of an enum.
macro_rules! choices {
    ($($type:ty { $($word:literal => $value:expr,)* })*) => {$(
        impl $crate::read::Read for $type {
            fn read(node: &$crate::tree::Node, reader: &mut $crate::read::Reader) -> Option<Self> {
                let index = reader.choice(node, &[$($word),*], &[])?;
                [$($value),*].into_iter().nth(index)
            }

            fn schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!({ "enum": [$($word),*] })
            }
        }
    )*};
}

pub(crate) use {choices, table};
