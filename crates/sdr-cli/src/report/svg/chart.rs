//! A line over time, with bars (levels that matter) and marks (moments that matter).

use std::fmt::Write as _;

use super::{
    Anchor, LEFT, RIGHT, Svg, TimeAxis,
    axis::{figure, ticks},
};

/// Height of a line's panel, its title included.
pub(super) const HEIGHT: f64 = 150.0;
const TITLE: f64 = 22.0;
const FOOT: f64 = 10.0;
/// Points more than this for each unit of width are thinned out; the extremes stay.
const POINTS_MAX: usize = 1400;

/// One quantity over time.
pub(crate) struct LinePanel {
    /// What it is.
    pub(crate) title: String,
    /// Its unit.
    pub(crate) unit: String,
    /// (second, value); a value that is not a number is a gap.
    pub(crate) points: Vec<(f64, f64)>,
    /// Levels that matter.
    pub(crate) bars: Vec<Bar>,
    /// Whether the scale begins at zero.
    pub(crate) zero: bool,
}

/// A level that matters.
pub(crate) struct Bar {
    /// The level.
    pub(crate) at: f64,
    /// Its words.
    pub(crate) label: String,
}

/// A moment that matters, drawn through all panels.
pub(crate) struct Mark {
    /// When.
    pub(crate) at_s: f64,
    /// What.
    pub(crate) kind: MarkKind,
}

/// The two lines of the paper's Figures 4 to 6.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum MarkKind {
    /// Orange, dashed.
    Allocation,
    /// Purple, dash-dot.
    Recovery,
}

impl Mark {
    pub(super) fn draw(&self, svg: &mut Svg, axis: &TimeAxis, (top, bottom): (f64, f64)) {
        if !axis.shows(self.at_s) {
            return;
        }
        let class = match self.kind {
            MarkKind::Allocation => "mark allocation",
            MarkKind::Recovery => "mark recovery",
        };
        let x = axis.x(self.at_s);
        svg.line(class, (x, top), (x, bottom));
    }
}

impl LinePanel {
    /// From where to where marks go through it.
    pub(super) fn spans(&self, top: f64) -> (f64, f64) {
        (top + TITLE, top + HEIGHT - FOOT)
    }

    pub(super) fn draw(&self, svg: &mut Svg, axis: &TimeAxis, top: f64, letter: char) {
        let (upper, lower) = self.spans(top);
        svg.text(
            "title",
            (LEFT, top + 15.0),
            Anchor::Start,
            &format!("({letter}) {}, {}", self.title, self.unit),
        );
        svg.rect("plot", (LEFT, upper), (RIGHT - LEFT, lower - upper), "");
        let Some((low, high)) = self.range() else {
            svg.text(
                "tick",
                ((LEFT + RIGHT) / 2.0, (upper + lower) / 2.0),
                Anchor::Middle,
                "not recorded",
            );
            return;
        };
        let y = |value: f64| lower - (value - low) / (high - low) * (lower - upper);
        let levels = ticks(low, high, 5);
        for &level in &levels {
            svg.line("grid", (LEFT, y(level)), (RIGHT, y(level)));
            svg.text("tick", (LEFT - 6.0, y(level) + 4.0), Anchor::End, &figure(level, &levels));
        }
        for &second in &axis.ticks() {
            svg.line("grid", (axis.x(second), upper), (axis.x(second), lower));
        }
        let points = thin(&self.points, POINTS_MAX);
        svg.path("value", &path(points.iter().map(|&(at, value)| (axis.x(at), y(value)))));
        for bar in &self.bars {
            svg.line("bar", (LEFT, y(bar.at)), (RIGHT, y(bar.at)));
            svg.text("bar-label", (LEFT + 6.0, y(bar.at) - 4.0), Anchor::Start, &bar.label);
        }
    }

    /// Lowest and highest of what is drawn, with some air; `None` when nothing is.
    fn range(&self) -> Option<(f64, f64)> {
        let values = self.points.iter().map(|point| point.1).filter(|value| value.is_finite());
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        if low > high {
            return None;
        }
        let bars = self.bars.iter().map(|bar| bar.at);
        let (low, high) = bars.fold((low, high), |(low, high), at| (low.min(at), high.max(at)));
        let low = if self.zero { low.min(0.0) } else { low };
        let air = ((high - low) * 0.08).max(0.5);
        Some((if self.zero && low >= 0.0 { low } else { low - air }, high + air))
    }
}

/// The path through the points; a point that is not finite breaks it.
pub(super) fn path(points: impl Iterator<Item = (f64, f64)>) -> String {
    let mut d = String::new();
    let mut down = false;
    for (x, y) in points {
        if x.is_finite() && y.is_finite() {
            let word = if down { 'L' } else { 'M' };
            write!(d, "{word}{x:.1} {y:.1} ").expect("writing to a string cannot fail");
            down = true;
        } else {
            down = false;
        }
    }
    d.truncate(d.trim_end().len());
    d
}

/// At most about `count` of the points; of each group the lowest and the highest stay.
fn thin(points: &[(f64, f64)], count: usize) -> Vec<(f64, f64)> {
    if points.len() <= count {
        return points.to_vec();
    }
    let size = (points.len() * 2).div_ceil(count);
    let mut thinned = Vec::with_capacity(count);
    for group in points.chunks(size) {
        if let Some(gap) = group.iter().find(|point| !point.1.is_finite()) {
            thinned.push(*gap);
            continue;
        }
        let mut sorted = group.to_vec();
        sorted.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (Some(&low), Some(&high)) = (sorted.first(), sorted.last()) else { continue };
        let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
        thinned.push(first);
        thinned.push(second);
    }
    thinned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_unknown_is_a_gap_not_a_number() {
        let points = [(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, 4.0), (4.0, 5.0)];
        assert_eq!(path(points.into_iter()), "M0.0 1.0 L1.0 2.0 M3.0 4.0 L4.0 5.0");
        assert_eq!(path(std::iter::empty()), "");
    }

    #[test]
    fn thinning_keeps_the_extremes() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), 1.0)).collect();
        points[77_777].1 = 9.0;
        points[3].1 = -9.0;

        let thinned = thin(&points, 1000);

        assert!(thinned.len() <= 1002, "{}", thinned.len());
        assert!(thinned.contains(&(77_777.0, 9.0)) && thinned.contains(&(3.0, -9.0)));
        assert!(thinned.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    #[test]
    fn a_panel_without_any_value_says_so() {
        let panel = LinePanel {
            title: "RSSI".to_owned(),
            unit: "dBm".to_owned(),
            points: vec![(0.0, f64::NAN)],
            bars: Vec::new(),
            zero: false,
        };
        let mut svg = Svg::new(1.0, 1.0, "");
        panel.draw(&mut svg, &TimeAxis::new(0.0, 1.0), 0.0, 'a');
        assert!(svg.finish().contains("not recorded"));
    }

    #[test]
    fn a_bar_outside_the_values_is_still_on_the_scale() {
        let panel = LinePanel {
            title: String::new(),
            unit: String::new(),
            points: vec![(0.0, -47.0), (1.0, -47.5)],
            bars: vec![Bar { at: -52.5, label: String::new() }],
            zero: false,
        };
        let (low, high) = panel.range().unwrap();
        assert!(low < -52.5 && high > -47.0);
    }
}
