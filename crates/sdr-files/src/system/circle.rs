//! Circles in the start order.

use sdr_core::id::Name;

/// A circle among `after`, first name again at the end; `None` when there is none.
pub(super) fn circle(order: &[(Name, Vec<Name>)]) -> Option<Vec<Name>> {
    // Takes away what can start until nothing more can; what is left leads into a circle.
    let mut waiting: Vec<&(Name, Vec<Name>)> = order.iter().collect();
    loop {
        let before = waiting.len();
        let names: Vec<&Name> = waiting.iter().map(|(name, _)| name).collect();
        waiting.retain(|(_, after)| after.iter().any(|name| names.contains(&name)));
        if waiting.len() == before {
            break;
        }
    }
    let mut path: Vec<Name> = vec![waiting.first()?.0.clone()];
    // Each step goes to something that waits too, so a name comes again within as many steps.
    for _ in 0..waiting.len() {
        let last = path.last()?;
        let (_, after) = waiting.iter().find(|(name, _)| name == last)?;
        let next = after.iter().find(|name| waiting.iter().any(|(other, _)| other == *name))?;
        if let Some(start) = path.iter().position(|name| name == next) {
            path.push(next.clone());
            return Some(path.split_off(start));
        }
        path.push(next.clone());
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_circle_is_named_without_what_leads_to_it() {
        let name = |word: &str| Name::new(word).unwrap();
        let order = |pairs: &[(&str, &[&str])]| {
            pairs
                .iter()
                .map(|(word, after)| (name(word), after.iter().map(|word| name(word)).collect()))
                .collect::<Vec<(Name, Vec<Name>)>>()
        };

        assert_eq!(circle(&order(&[("a", &[]), ("b", &["a"])])), None);
        let round = circle(&order(&[("a", &["b"]), ("b", &["c"]), ("c", &["b"])])).unwrap();
        assert_eq!(round, [name("b"), name("c"), name("b")]);
    }
}
