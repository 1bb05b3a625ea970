//! What a level means for frames: rate, and the share of tries that fail (802.11n, 20 MHz).

/// One way to send.
#[derive(Debug)]
struct Scheme {
    bits_per_second: f64,
    /// SNR at which half of the long frames are lost, and at which one in ten is.
    long: (f64, f64),
    /// The same for short ones.
    short: (f64, f64),
}

/// Frames of this length have the SNRs of `Scheme::long`, bytes.
const LONG_BYTES: f64 = 1458.0;
/// Frames of this length have the SNRs of `Scheme::short`, bytes.
const SHORT_BYTES: f64 = 32.0;
/// A sender stays this far above what its receiver just manages, dB.
const MARGIN_DB: f64 = 3.0;

/// MCS 0 to 7, one stream, long guard interval.
const SCHEMES: [Scheme; 8] = [
    Scheme { bits_per_second: 6.5e6, long: (0.30, 0.92), short: (-1.34, -0.36) },
    Scheme { bits_per_second: 13.0e6, long: (3.30, 3.94), short: (1.66, 2.61) },
    Scheme { bits_per_second: 19.5e6, long: (5.78, 6.43), short: (4.17, 5.10) },
    Scheme { bits_per_second: 26.0e6, long: (8.92, 9.70), short: (6.94, 8.06) },
    Scheme { bits_per_second: 39.0e6, long: (12.02, 12.80), short: (10.18, 11.28) },
    Scheme { bits_per_second: 52.0e6, long: (16.22, 17.04), short: (14.06, 15.31) },
    Scheme { bits_per_second: 58.5e6, long: (17.52, 18.38), short: (15.42, 16.61) },
    Scheme { bits_per_second: 65.0e6, long: (18.80, 19.63), short: (16.84, 18.08) },
];

impl Scheme {
    /// Share of single tries that fail.
    fn loss(&self, snr_db: f64, bytes: usize) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a frame's length")]
        let bytes = (bytes as f64).clamp(SHORT_BYTES, LONG_BYTES);
        let share = (bytes / SHORT_BYTES).ln() / (LONG_BYTES / SHORT_BYTES).ln();
        let between = |short: f64, long: f64| short + (long - short) * share;
        let half = between(self.short.0, self.long.0);
        let tenth = between(self.short.1, self.long.1);
        // A logistic curve through both points; it meets the third published one, 1 %, too.
        1.0 / (1.0 + 9.0_f64.powf(((snr_db - half) / (tenth - half)).clamp(-200.0, 200.0)))
    }
}

/// How a frame goes over a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sending {
    pub(super) bits_per_second: f64,
    /// Share of single tries that fail.
    pub(super) try_loss: f64,
}

/// To one receiver: the fastest scheme that it manages well.
pub(super) fn to_one(snr_db: f64, bytes: usize) -> Sending {
    let well = |scheme: &&Scheme| snr_db >= scheme.long.1 + MARGIN_DB;
    let scheme = SCHEMES.iter().rfind(well).unwrap_or(&SCHEMES[0]);
    Sending { bits_per_second: scheme.bits_per_second, try_loss: scheme.loss(snr_db, bytes) }
}

/// To all: the slowest, which reaches farthest.
pub(super) fn to_all(snr_db: f64, bytes: usize) -> Sending {
    let scheme = &SCHEMES[0];
    Sending { bits_per_second: scheme.bits_per_second, try_loss: scheme.loss(snr_db, bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_meets_the_published_points() {
        let near = |found: f64, wanted: f64| (found / wanted - 1.0).abs() < 0.35;
        let one_per_cent = [1.56, 4.60, 7.11, 10.48, 13.56, 17.98, 19.31, 20.50];
        for (scheme, snr) in SCHEMES.iter().zip(one_per_cent) {
            assert!((scheme.loss(scheme.long.0, 1458) - 0.5).abs() < 1e-9);
            assert!((scheme.loss(scheme.long.1, 1458) - 0.1).abs() < 1e-9);
            assert!(near(scheme.loss(snr, 1458), 0.01), "{}", scheme.loss(snr, 1458));
        }
    }

    #[test]
    fn a_weaker_link_is_slower_and_then_deaf() {
        assert!((to_one(47.0, 1458).bits_per_second - 65.0e6).abs() < 1.0);
        assert!(to_one(47.0, 1458).try_loss < 1e-6);
        assert!((to_one(5.0, 1458).bits_per_second - 6.5e6).abs() < 1.0);
        assert!(to_one(-3.0, 1458).try_loss > 0.999);
        assert!(to_all(0.0, 60).try_loss < to_all(0.0, 1458).try_loss);
    }
}
