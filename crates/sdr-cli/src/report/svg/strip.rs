//! The states of one instance over time, as the paper's figures show them.

use super::{Anchor, LEFT, RIGHT, Svg, TimeAxis, writer::columns};

/// Height of a strip's panel, its title included.
pub(super) const HEIGHT: f64 = 58.0;
const TITLE: f64 = 20.0;
const FULL: f64 = 28.0;

/// The states of one component on one robot.
pub(crate) struct Strip {
    /// Which component.
    pub(crate) title: String,
    /// Its states; between them there was no instance.
    pub(crate) pieces: Vec<StripPiece>,
}

/// One state for a while.
pub(crate) struct StripPiece {
    /// From, seconds.
    pub(crate) from_s: f64,
    /// Until, seconds.
    pub(crate) until_s: f64,
    /// The state.
    pub(crate) state: StripState,
    /// Written into the piece where there is room.
    pub(crate) label: String,
}

/// What can be told apart in a strip; height tells it too, not colour alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StripState {
    /// Created or inactive.
    Inactive,
    /// Active.
    Active,
    /// In error.
    Error,
}

impl StripState {
    fn class(self) -> &'static str {
        match self {
            Self::Inactive => "inactive",
            Self::Active => "active",
            Self::Error => "error",
        }
    }

    fn height(self) -> f64 {
        match self {
            Self::Inactive => FULL * 0.4,
            Self::Active | Self::Error => FULL,
        }
    }
}

impl Strip {
    /// From where to where marks go through it.
    pub(super) fn spans(&self, top: f64) -> (f64, f64) {
        (top + TITLE - 4.0, top + TITLE + FULL)
    }

    pub(super) fn draw(&self, svg: &mut Svg, axis: &TimeAxis, top: f64, letter: char) {
        let foot = top + TITLE + FULL;
        let title = format!("({letter}) {}", self.title);
        svg.text("title", (LEFT, top + 14.0), Anchor::Start, &title);
        for (share, word) in [(1.0, "active"), (0.4, "inactive")] {
            let y = foot - FULL * share;
            svg.line("grid", (LEFT, y), (RIGHT, y));
            svg.text("tick", (LEFT - 6.0, y + 7.0), Anchor::End, word);
        }
        for piece in &self.pieces {
            let (from, until) = (axis.x(piece.from_s), axis.x(piece.until_s));
            // What lasted shorter than a hair is still seen.
            let size = ((until - from).max(1.0), piece.state.height());
            let hint = format!(
                "{} {} from {:.2} s to {:.2} s",
                self.title, piece.label, piece.from_s, piece.until_s
            );
            svg.rect(piece.state.class(), (from, foot - size.1), size, &hint);
            let middle = ((from + until) / 2.0, foot - size.1 / 2.0 + 4.0);
            if size.0 > 7.0 * columns(&piece.label) && size.1 >= FULL {
                svg.text("on-colour", middle, Anchor::Middle, &piece.label);
            }
        }
        svg.line("axis", (LEFT, foot), (RIGHT, foot));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_error_is_seen_and_has_its_own_height() {
        let piece = |from_s, until_s, state| StripPiece {
            from_s,
            until_s,
            state,
            label: "epoch 1".to_owned(),
        };
        let strip = Strip {
            title: "anomaly".to_owned(),
            pieces: vec![
                piece(0.0, 1.0, StripState::Inactive),
                piece(1.0, 50.0, StripState::Active),
                piece(50.0, 50.0001, StripState::Error),
            ],
        };
        let mut svg = Svg::new(1.0, 1.0, "");
        strip.draw(&mut svg, &TimeAxis::new(0.0, 100.0), 0.0, 'c');
        let text = svg.finish();

        assert!(text.contains("class=\"error\"") && text.contains("width=\"1.0\""), "{text}");
        assert_eq!(text.matches(">epoch 1</text>").count(), 1, "{text}");
    }
}
