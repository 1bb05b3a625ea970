//! Licence expressions: names joined by `OR`, `AND`, and parentheses.

/// Whether the expression can be met with licences that `allowed` accepts.
pub(super) fn is_met(expression: &str, allowed: &dyn Fn(&str) -> bool) -> bool {
    // Before SPDX, `/` meant `OR`.
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut reader = Reader { words: &words, allowed };
    reader.any() && reader.words.is_empty()
}

struct Reader<'a> {
    words: &'a [&'a str],
    allowed: &'a dyn Fn(&str) -> bool,
}

impl Reader<'_> {
    fn any(&mut self) -> bool {
        let mut met = self.all();
        while self.take("OR") {
            met |= self.all();
        }
        met
    }

    fn all(&mut self) -> bool {
        let mut met = self.one();
        while self.take("AND") {
            met &= self.one();
        }
        met
    }

    fn one(&mut self) -> bool {
        if self.take("(") {
            let met = self.any();
            return self.take(")") && met;
        }
        let Some((name, rest)) = self.words.split_first() else { return false };
        self.words = rest;
        if self.take("WITH") {
            // Exceptions only give, they never take.
            self.words = self.words.get(1..).unwrap_or_default();
        }
        (self.allowed)(name)
    }

    fn take(&mut self, word: &str) -> bool {
        match self.words.split_first() {
            Some((first, rest)) if *first == word => {
                self.words = rest;
                true
            }
            _ => false,
        }
    }
}

#[test]
fn expressions_are_read_as_spdx_has_them() {
    let mit = |name: &str| name == "MIT";

    assert!(is_met("MIT", &mit));
    assert!(is_met("GPL-3.0-only OR MIT", &mit));
    assert!(is_met("Apache-2.0/MIT", &mit));
    assert!(is_met("(Apache-2.0 OR MIT) AND MIT", &mit));
    assert!(is_met("MIT WITH some-exception", &mit));

    assert!(!is_met("GPL-3.0-only", &mit));
    assert!(!is_met("MIT AND BSD-3-Clause", &mit));
    assert!(!is_met("(MIT", &mit));
    assert!(!is_met("MIT MIT", &mit));
    assert!(!is_met("", &mit));
}
