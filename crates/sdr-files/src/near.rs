//! Near misses: which allowed word was probably meant.

/// The allowed word nearest to `word`, when it is near enough to be a slip.
pub(crate) fn nearest<'a>(
    word: &str,
    allowed: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let slips_max = word.chars().count().div_ceil(3).min(3);
    allowed
        .into_iter()
        .map(|candidate| (distance(word, candidate), candidate))
        .filter(|(slips, _)| *slips <= slips_max)
        .min_by_key(|(slips, _)| *slips)
        .map(|(_, candidate)| candidate)
}

/// `allowed: a, b, c (did you mean `b`?)`.
pub(crate) fn allowed_words(word: &str, allowed: &[&str]) -> String {
    if allowed.is_empty() {
        return String::from("there is none");
    }
    let list = allowed.join(", ");
    match nearest(word, allowed.iter().copied()) {
        Some(meant) => format!("allowed: {list} (did you mean `{meant}`?)"),
        None => format!("allowed: {list}"),
    }
}

/// Single-character insertions, removals and changes from `a` to `b`; case and the kind of
/// dash count nothing.
fn distance(a: &str, b: &str) -> usize {
    let plain = |word: &str| word.to_lowercase().replace('-', "_").chars().collect::<Vec<char>>();
    let (a, b) = (plain(a), plain(b));
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let change = diagonal + usize::from(from != to);
            diagonal = row[j + 1];
            row[j + 1] = change.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_finds_the_word_that_was_meant() {
        let words = ["rate", "run", "parameters"];
        assert_eq!(nearest("rat", words), Some("rate"));
        assert_eq!(nearest("paramters", words), Some("parameters"));
        assert_eq!(nearest("colour", words), None);
        assert_eq!(nearest("local_first", ["local-first"]), Some("local-first"));
    }
}
