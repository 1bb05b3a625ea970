//! Figures as SVG: a small writer, and the three kinds of figure of a report.
//!
//! Colours are CSS variables of the page (`style.css`), so that one figure reads well in light and in dark.

mod axis;
mod chart;
mod graph;
mod strip;
mod writer;

pub(crate) use axis::TimeAxis;
pub(crate) use chart::{Bar, LinePanel, Mark, MarkKind};
pub(crate) use graph::{Graph, GraphBox, GraphEdge};
pub(crate) use strip::{Strip, StripPiece, StripState};
pub(crate) use writer::{Anchor, Svg, escape};

/// Width of every figure, in its own units.
pub(crate) const WIDTH: f64 = 760.0;
/// Where plots begin: room for the ticks' figures.
const LEFT: f64 = 64.0;
/// Where plots end: room for the words of bars.
const RIGHT: f64 = WIDTH - 12.0;

/// One part of a figure over time.
pub(crate) enum Panel {
    /// A line, such as free memory.
    Line(LinePanel),
    /// What state an instance was in.
    Strip(Strip),
}

/// Draws panels one below the other over one axis of time; `label` says what it shows to those
/// who cannot see it.
pub(crate) fn stack(label: &str, axis: &TimeAxis, panels: &[Panel], marks: &[Mark]) -> String {
    let heights = panels.iter().map(|panel| match panel {
        Panel::Line(_) => chart::HEIGHT,
        Panel::Strip(_) => strip::HEIGHT,
    });
    let height = heights.sum::<f64>() + axis::HEIGHT;
    let mut svg = Svg::new(WIDTH, height, label);
    let mut top = 0.0;
    for (index, panel) in panels.iter().enumerate() {
        let letter = char::from(b'a'.saturating_add(u8::try_from(index).unwrap_or(25)));
        match panel {
            Panel::Line(panel) => {
                panel.draw(&mut svg, axis, top, letter);
                marks.iter().for_each(|mark| mark.draw(&mut svg, axis, panel.spans(top)));
                top += chart::HEIGHT;
            }
            Panel::Strip(panel) => {
                panel.draw(&mut svg, axis, top, letter);
                marks.iter().for_each(|mark| mark.draw(&mut svg, axis, panel.spans(top)));
                top += strip::HEIGHT;
            }
        }
    }
    axis.draw(&mut svg, top);
    svg.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_stand_below_each_other_and_share_their_axis() {
        let line = LinePanel {
            title: "Free memory".to_owned(),
            unit: "MB".to_owned(),
            points: vec![(0.0, 1900.0), (5.0, 840.0)],
            bars: vec![Bar { at: 500.0, label: "Table V: 500 MB".to_owned() }],
            zero: true,
        };
        let strip = Strip { title: "fisheye".to_owned(), pieces: Vec::new() };

        let axis = TimeAxis::new(0.0, 10.0);
        let text = stack("robot-1", &axis, &[Panel::Line(line), Panel::Strip(strip)], &[]);

        assert!(text.starts_with("<svg ") && text.ends_with("</svg>\n"), "{text}");
        for part in ["(a) Free memory", "(b) fisheye", "Table V: 500 MB", "time, s"] {
            assert!(text.contains(part), "{part} in {text}");
        }
        assert!(!text.contains("NaN"), "{text}");
    }
}
