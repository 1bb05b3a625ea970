//! What all benches share: finding the programs, and a few figures of many.

use std::{
    io::{self, Write},
    path::PathBuf,
};

/// CLOCK_MONOTONIC, as agents and components tell it.
pub fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    let (seconds, nanos) = (u64::try_from(now.tv_sec), u64::try_from(now.tv_nsec));
    seconds.unwrap_or(0) * 1_000_000_000 + nanos.unwrap_or(0)
}

/// The programs of the profile this bench was built in.
pub fn programs() -> io::Result<PathBuf> {
    let own = std::env::current_exe()?;
    let folder = own.parent().map(PathBuf::from).unwrap_or_default();
    match folder.join("sdr").exists() && folder.join("sdr-agent").exists() {
        true => Ok(folder),
        false => Err(io::Error::other("sdr and sdr-agent are missing: cargo build --release")),
    }
}

/// Measured values of one figure.
#[derive(Clone, Debug, Default)]
pub struct Series(Vec<f64>);

impl Series {
    /// Takes one more value.
    pub fn push(&mut self, value: f64) {
        self.0.push(value);
        self.0.sort_by(f64::total_cmp);
    }

    /// The value below which `percent` of all lie; `None` without values.
    pub fn percentile(&self, percent: usize) -> Option<f64> {
        let rank = (self.0.len() * percent).div_ceil(100).max(1);
        self.0.get(rank - 1).copied()
    }

    /// The greatest.
    pub fn worst(&self) -> Option<f64> {
        self.0.last().copied()
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.0.len()
    }
}

/// One line of a table on stdout.
pub fn line(text: &str) -> io::Result<()> {
    writeln!(io::stdout().lock(), "{text}")
}

/// `name  p50  worst  bar`, aligned.
pub fn row(name: &str, series: &Series, bar: &str, digits: usize) -> io::Result<()> {
    let number = |value: Option<f64>| {
        value.map_or_else(|| "-".to_string(), |value| format!("{value:.digits$}"))
    };
    let (p50, worst) = (number(series.percentile(50)), number(series.worst()));
    line(&format!("{name:<44} {p50:>9} {worst:>9}   {bar:<12} n={}", series.count()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_that_were_measured() {
        let mut series = Series::default();
        assert_eq!(series.percentile(50), None);
        for value in [5.0, 1.0, 3.0, 2.0, 4.0] {
            series.push(value);
        }
        assert_eq!((series.percentile(50), series.worst()), (Some(3.0), Some(5.0)));
        assert_eq!(series.percentile(99), Some(5.0));
    }
}
