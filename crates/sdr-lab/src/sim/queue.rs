//! What is due: one heap, ordered by time, then by the order in which it was put in.

use std::{cmp::Reverse, collections::BinaryHeap};

use sdr_core::time::Instant;

/// A heap of things due in virtual time; equal moments keep the order of [`Queue::push`].
#[derive(Debug)]
pub(crate) struct Queue<T> {
    /// Moment, sequence, place: small, since a heap moves its entries about.
    heap: BinaryHeap<Reverse<(Instant, u64, usize)>>,
    places: Vec<Option<T>>,
    free: Vec<usize>,
    sequence: u64,
}

impl<T> Queue<T> {
    pub(crate) fn new() -> Self {
        Self { heap: BinaryHeap::new(), places: Vec::new(), free: Vec::new(), sequence: 0 }
    }

    pub(crate) fn push(&mut self, at: Instant, due: T) {
        self.sequence += 1;
        let place = match self.free.pop() {
            Some(place) => {
                self.places[place] = Some(due);
                place
            }
            None => {
                self.places.push(Some(due));
                self.places.len() - 1
            }
        };
        self.heap.push(Reverse((at, self.sequence, place)));
    }

    /// The next thing, when it is due at `end` or before.
    pub(crate) fn pop_until(&mut self, end: Instant) -> Option<(Instant, T)> {
        if self.heap.peek().is_none_or(|Reverse((at, ..))| *at > end) {
            return None;
        }
        let Reverse((at, _, place)) = self.heap.pop()?;
        self.free.push(place);
        self.places[place].take().map(|due| (at, due))
    }

    pub(crate) fn len(&self) -> usize {
        self.heap.len()
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
