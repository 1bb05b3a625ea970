//! Facts by the hash of their key: looked through for every record that comes.

use alloc::{sync::Arc, vec, vec::Vec};

use super::fact::Fact;

/// Upper bits of a hash that name its bucket.
const BUCKET_BITS: u32 = 12;

/// Buckets of facts in the order of their hashes. Hashes are evenly spread: of tens of
/// thousands of facts a bucket holds a handful, side by side.
#[derive(Clone, Debug, Default)]
pub(super) struct ByHash {
    /// Empty while there are no facts.
    buckets: Vec<Vec<(u32, Arc<Fact>)>>,
}

impl ByHash {
    /// The fact with this hash that is the one looked for.
    pub(super) fn find(&self, hash: u32, is_it: impl Fn(&Fact) -> bool) -> Option<&Arc<Fact>> {
        let bucket = self.buckets.get(bucket_of(hash))?;
        let mut facts = bucket.iter();
        facts.find(|(of, fact)| *of == hash && is_it(fact)).map(|(_, fact)| fact)
    }

    /// Facts with a hash in `low..=high`, in the order of their hashes.
    pub(super) fn range(&self, low: u32, high: u32) -> impl Iterator<Item = &Arc<Fact>> {
        let buckets = match self.buckets.is_empty() || low > high {
            true => &[],
            false => &self.buckets[bucket_of(low)..=bucket_of(high)],
        };
        let facts = buckets.iter().flatten();
        facts.filter(move |(hash, _)| (low..=high).contains(hash)).map(|(_, fact)| fact)
    }

    /// Puts a fact in, in place of that with its key.
    pub(super) fn put(&mut self, fact: &Arc<Fact>) {
        if self.buckets.is_empty() {
            self.buckets = vec![Vec::new(); 1 << BUCKET_BITS];
        }
        let bucket = &mut self.buckets[bucket_of(fact.hash())];
        match place_of(bucket, fact) {
            Ok(place) => bucket[place].1 = Arc::clone(fact),
            Err(place) => bucket.insert(place, (fact.hash(), Arc::clone(fact))),
        }
    }

    /// Takes the fact with this one's key out.
    pub(super) fn remove(&mut self, fact: &Fact) {
        let Some(bucket) = self.buckets.get_mut(bucket_of(fact.hash())) else { return };
        if let Ok(place) = place_of(bucket, fact) {
            bucket.remove(place);
        }
    }
}

fn place_of(bucket: &[(u32, Arc<Fact>)], fact: &Fact) -> Result<usize, usize> {
    bucket.binary_search_by(|(hash, held)| {
        hash.cmp(&fact.hash()).then_with(|| held.key().cmp(fact.key()))
    })
}

fn bucket_of(hash: u32) -> usize {
    usize::try_from(hash >> (32 - BUCKET_BITS)).unwrap_or(0)
}
