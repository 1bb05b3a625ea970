//! Each counter once.

/// How far behind the greatest counter a datagram may be.
pub(super) const WINDOW: u64 = 1024;
const WORDS: usize = 16;

/// The last 1,024 counters of one sender start (after RFC 6479).
#[derive(Clone, Debug)]
pub(super) struct Window {
    greatest: u64,
    /// Bit c % 1024: counter c came.
    seen: [u64; WORDS],
}

impl Window {
    /// Everything up to `counter` counts as seen.
    pub(super) fn after(counter: u64) -> Self {
        Self { greatest: counter, seen: [u64::MAX; WORDS] }
    }

    /// Whether `counter` comes for the first time; from now on it does not.
    pub(super) fn admit(&mut self, counter: u64) -> bool {
        if counter > self.greatest {
            let fresh = (counter - self.greatest).min(WINDOW);
            for step in 1..=fresh {
                self.clear(counter - fresh + step);
            }
            self.greatest = counter;
        } else if self.greatest - counter >= WINDOW || self.has(counter) {
            return false;
        }
        let (word, bit) = place(counter);
        self.seen[word] |= bit;
        true
    }

    fn has(&self, counter: u64) -> bool {
        let (word, bit) = place(counter);
        self.seen[word] & bit != 0
    }

    fn clear(&mut self, counter: u64) {
        let (word, bit) = place(counter);
        self.seen[word] &= !bit;
    }
}

fn place(counter: u64) -> (usize, u64) {
    let index = counter % WINDOW;
    let word = usize::try_from(index / 64).expect("below 16");
    (word, 1 << (index % 64))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn no_counter_passes_twice_and_every_fresh_one_near_the_front_passes(
            first in 0_u64..5,
            counters in prop::collection::vec(0_u64..5000, 1..400),
        ) {
            let mut window = Window::after(first);
            let mut seen: BTreeSet<u64> = (0..=first).collect();
            let mut greatest = first;
            for counter in counters {
                let near = counter + WINDOW > greatest;
                prop_assert_eq!(window.admit(counter), near && seen.insert(counter));
                greatest = greatest.max(counter);
            }
        }
    }

    #[test]
    fn a_leap_forgets_only_what_is_too_old() {
        let mut window = Window::after(0);
        assert!(window.admit(5));
        assert!(window.admit(5 + WINDOW - 1));
        assert!(!window.admit(5));
        assert!(window.admit(6));
        assert!(window.admit(u64::from(u32::MAX)));
        assert!(!window.admit(6 + WINDOW));
    }
}
