//! Scales and ticks.

use super::{Anchor, LEFT, RIGHT, Svg};

/// Room below the panels for the axis of time.
pub(super) const HEIGHT: f64 = 38.0;

/// Seconds of the run along the width of a figure.
pub(crate) struct TimeAxis {
    from_s: f64,
    to_s: f64,
}

impl TimeAxis {
    /// From and to, seconds; at least a tenth of a second is shown.
    pub(crate) fn new(from_s: f64, to_s: f64) -> Self {
        Self { from_s, to_s: to_s.max(from_s + 0.1) }
    }

    /// Where a second stands; outside the axis it is held at the end.
    pub(super) fn x(&self, at_s: f64) -> f64 {
        let share = (at_s - self.from_s) / (self.to_s - self.from_s);
        LEFT + share.clamp(0.0, 1.0) * (RIGHT - LEFT)
    }

    /// Whether the second is on the axis.
    pub(super) fn shows(&self, at_s: f64) -> bool {
        (self.from_s..=self.to_s).contains(&at_s)
    }

    /// The seconds of the ticks.
    pub(super) fn ticks(&self) -> Vec<f64> {
        ticks(self.from_s, self.to_s, 10)
    }

    pub(super) fn draw(&self, svg: &mut Svg, top: f64) {
        svg.line("axis", (LEFT, top), (RIGHT, top));
        let ticks = self.ticks();
        for &tick in &ticks {
            let x = self.x(tick);
            svg.line("axis", (x, top), (x, top + 4.0));
            svg.text("tick", (x, top + 16.0), Anchor::Middle, &figure(tick, &ticks));
        }
        svg.text("tick", ((LEFT + RIGHT) / 2.0, top + 32.0), Anchor::Middle, "time, s");
    }
}

/// Round values from `from` to `to`, about `count` of them, in steps of 1, 2 or 5 times a power of ten.
pub(super) fn ticks(from: f64, to: f64, count: u32) -> Vec<f64> {
    let span = to - from;
    if !span.is_finite() || span <= 0.0 || count == 0 {
        return Vec::new();
    }
    let rough = span / f64::from(count);
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|step| *step >= rough * 0.7)
        .unwrap_or(10.0 * power);
    let mut ticks = Vec::new();
    let mut index = (from / step - 1e-9).ceil();
    while index * step <= to + step * 1e-9 && ticks.len() < 100 {
        // Adding zero turns -0 into 0.
        ticks.push(index * step + 0.0);
        index += 1.0;
    }
    ticks
}

/// A tick's figure, with as many decimals as its neighbours need.
pub(super) fn figure(tick: f64, ticks: &[f64]) -> String {
    let step = ticks.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    match step {
        wide if wide >= 0.999 || wide.is_infinite() => format!("{tick:.0}"),
        small if small >= 0.0999 => format!("{tick:.1}"),
        _ => format!("{tick:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_cover_the_range() {
        assert_eq!(ticks(0.0, 34.2, 7), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0]);
        assert_eq!(ticks(-58.3, -44.0, 4), [-55.0, -50.0, -45.0]);
        assert_eq!(ticks(0.0, 1900.0, 4), [0.0, 500.0, 1000.0, 1500.0]);
        let fine = ticks(0.0, 1.0, 5);
        assert_eq!(figure(fine[1], &fine), "0.2");
    }

    #[test]
    fn an_empty_or_broken_range_has_no_ticks() {
        assert!(ticks(1.0, 1.0, 5).is_empty());
        assert!(ticks(0.0, f64::NAN, 5).is_empty());
        assert!(ticks(f64::NEG_INFINITY, 0.0, 5).is_empty());
    }
}
