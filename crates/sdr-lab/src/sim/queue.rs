//! What is due: one heap, ordered by time, then by the order in which it was put in.

use std::{
    cmp::{Ordering, Reverse},
    collections::BinaryHeap,
};

use sdr_core::time::Instant;

/// Something due at a moment; equal moments keep the order of [`Queue::push`].
#[derive(Debug)]
struct Entry<T> {
    at: Instant,
    sequence: u64,
    due: T,
}

/// A heap of things due in virtual time.
#[derive(Debug)]
pub(crate) struct Queue<T> {
    heap: BinaryHeap<Reverse<Entry<T>>>,
    sequence: u64,
}

impl<T> Queue<T> {
    pub(crate) fn new() -> Self {
        Self { heap: BinaryHeap::new(), sequence: 0 }
    }

    pub(crate) fn push(&mut self, at: Instant, due: T) {
        self.sequence += 1;
        self.heap.push(Reverse(Entry { at, sequence: self.sequence, due }));
    }

    /// The next thing, when it is due at `end` or before.
    pub(crate) fn pop_until(&mut self, end: Instant) -> Option<(Instant, T)> {
        if self.heap.peek().is_none_or(|Reverse(entry)| entry.at > end) {
            return None;
        }
        self.heap.pop().map(|Reverse(entry)| (entry.at, entry.due))
    }

    pub(crate) fn len(&self) -> usize {
        self.heap.len()
    }
}

impl<T> PartialEq for Entry<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl<T> Eq for Entry<T> {}

impl<T> PartialOrd for Entry<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Entry<T> {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.at, self.sequence).cmp(&(other.at, other.sequence))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_moments_come_in_the_order_they_were_put_in() {
        let mut queue = Queue::new();
        for (millis, word) in [(2, "c"), (1, "a"), (1, "b"), (3, "d")] {
            queue.push(Instant::from_millis(millis), word);
        }
        let order: Vec<&str> = std::iter::from_fn(|| queue.pop_until(Instant::from_millis(2)))
            .map(|due| due.1)
            .collect();
        assert_eq!((order, queue.len()), (vec!["a", "b", "c"], 1));
    }
}
