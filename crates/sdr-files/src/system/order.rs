//! What components say of each other: names that are there, a start order without circle.

use sdr_core::id::Name;

use super::{circle::circle, file::ComponentTable};
use crate::{
    problem::Mark,
    read::{At, Reader},
};

pub(super) type Entries = [(At<String>, Option<At<ComponentTable>>)];

/// Names that a component gives of others are there, and not its own.
pub(super) fn check_names(entries: &Entries, names: &[&str], reader: &mut Reader) {
    for (own, table) in entries {
        let Some(table) = table else { continue };
        let place = table.value.place.as_ref();
        let lists = [
            ("after", table.value.after.as_ref()),
            ("apart_from", place.and_then(|place| place.apart_from.as_ref())),
            ("together_with", place.and_then(|place| place.together_with.as_ref())),
        ];
        for (key, list) in lists {
            for name in list.map(|list| list.value.as_slice()).unwrap_or_default() {
                if name.value.as_str() == own.value {
                    let message = format!("`{}` names itself in `{key}`", own.value);
                    reader.problem(name.mark, message, None);
                } else if !names.contains(&name.value.as_str()) {
                    reader.unknown(name.mark, "component", name.value.as_str(), names);
                }
            }
        }
    }
}

pub(super) fn check_start_order(entries: &Entries, reader: &mut Reader) {
    let order: Vec<(Name, Vec<Name>)> = entries
        .iter()
        .filter_map(|(name, table)| {
            let after = table.as_ref()?.value.after.as_ref();
            let after = after.map(|list| list.value.iter().map(|at| at.value.clone()).collect());
            Some((Name::new(&name.value).ok()?, after.unwrap_or_default()))
        })
        .collect();
    let Some(circle) = circle(&order) else { return };
    let words: Vec<&str> = circle.iter().map(Name::as_str).collect();
    let place = entries.iter().find(|(name, _)| name.value == words[0]).and_then(|(_, table)| {
        let after = table.as_ref()?.value.after.as_ref()?;
        after.value.iter().find(|at| at.value == circle[1]).map(|at| at.mark)
    });
    // A name of its own in `after` was told before.
    if words.len() > 2 {
        let message = format!("the start order goes round in a circle: {}", words.join(" after "));
        reader.problem(place.unwrap_or(Mark::FILE), message, None);
    }
}
