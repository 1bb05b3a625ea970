//! What a consumer wrote of the samples it accepted.

use std::fs;
use std::io;
use std::path::PathBuf;

/// One accepted sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sample {
    pub(crate) accepted_ns: u64,
    /// Epoch and run of its producer: one of each robot is enough here.
    pub(crate) token: (u64, u64),
    pub(crate) sequence: u64,
}

/// The file of one consumer.
#[derive(Clone, Debug)]
pub(crate) struct Samples(pub(crate) PathBuf);

impl Samples {
    /// All since `from_ns`, in the order of acceptance.
    pub(crate) fn since(&self, from_ns: u64) -> io::Result<Vec<Sample>> {
        let text = fs::read_to_string(&self.0)?;
        // The last line may not be whole yet.
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        let recent = whole.lines().rev().map_while(parse);
        let mut recent: Vec<Sample> = recent.take_while(|one| one.accepted_ns >= from_ns).collect();
        recent.reverse();
        Ok(recent)
    }

    /// Forgets what is there; the consumer appends and goes on.
    pub(crate) fn clear(&self) -> io::Result<()> {
        fs::File::options().write(true).open(&self.0)?.set_len(0)
    }
}

fn parse(line: &str) -> Option<Sample> {
    let mut fields = line.split(' ').map(str::parse::<u64>);
    let mut next = || fields.next()?.ok();
    let (accepted_ns, _sent, epoch, run, sequence) = (next()?, next()?, next()?, next()?, next()?);
    Some(Sample { accepted_ns, token: (epoch, run), sequence })
}

/// Samples missing, and samples there twice, in the sequences of each token.
pub(crate) fn gaps(samples: &[Sample]) -> (u64, u64) {
    samples.windows(2).filter(|pair| pair[0].token == pair[1].token).fold((0, 0), |sum, pair| {
        let (lost, twice) = sum;
        let missing = (pair[1].sequence).saturating_sub(pair[0].sequence + 1);
        (lost + missing, twice + u64::from(pair[1].sequence <= pair[0].sequence))
    })
}

/// The longest pause between two samples, nanoseconds.
pub(crate) fn longest_pause_ns(samples: &[Sample]) -> u64 {
    let pauses = samples.windows(2).map(|pair| pair[1].accepted_ns - pair[0].accepted_ns);
    pauses.max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(accepted_ns: u64, run: u64, sequence: u64) -> Sample {
        Sample { accepted_ns, token: (1, run), sequence }
    }

    #[test]
    fn gaps_are_counted_within_a_token_only() {
        let samples = [
            sample(1, 1, 7),
            sample(2, 1, 8),
            sample(5, 1, 11),
            sample(6, 2, 1),
            sample(7, 2, 1),
            sample(8, 2, 2),
        ];
        assert_eq!(gaps(&samples), (2, 1));
        assert_eq!(longest_pause_ns(&samples), 3);
    }

    #[test]
    fn a_line_that_is_not_whole_yet_waits() {
        let folder = tempfile::tempdir().unwrap();
        let samples = Samples(folder.path().join("s"));
        fs::write(&samples.0, "10 9 1 1 1\n20 19 1 1 2\n30 2").unwrap();
        assert_eq!(samples.since(15).unwrap(), [sample(20, 1, 2)]);
    }
}
