//! Paint of a pixel: its colour with brightness and tint of the light taken out.

use sdr_lab::tunnel::Colour;

use super::View;

/// Darker pixels have no reliable colour, of 255.
const DARK: f32 = 26.0;
/// Pixels with less colour than this count as grey for the balance.
const GREY: f32 = 0.25;
/// How much of the light's tint is believed: a picture full of one colour is not its light.
const GAIN_RANGE: std::ops::RangeInclusive<f32> = 0.75..=1.33;
/// Fewer grey pixels than this share of a picture say nothing about the light.
const GREY_SHARE_MIN: usize = 10;

/// Gains that make the grey things of a picture grey.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Balance {
    gains: [f32; 3],
}

impl Balance {
    /// Changes nothing.
    pub const NEUTRAL: Self = Self { gains: [1.0; 3] };

    /// The balance of a picture, from its pixels without strong colour.
    pub fn of(view: &View<'_>) -> Self {
        let (mut sums, mut greys, mut pixels) = ([0.0_f32; 3], 0_usize, 0_usize);
        // One pixel in seven says the same as all of them.
        for pixel in view.pixels().step_by(7) {
            pixels += 1;
            let [r, g, b] = pixel.map(f32::from);
            let (high, low) = (r.max(g).max(b), r.min(g).min(b));
            if (DARK..250.0).contains(&high) && (high - low) < GREY * high {
                greys += 1;
                // Chromaticity, so that bright walls do not outvote dark ones.
                let sum = r + g + b;
                sums = [sums[0] + r / sum, sums[1] + g / sum, sums[2] + b / sum];
            }
        }
        if greys * GREY_SHARE_MIN < pixels || greys == 0 {
            return Self::NEUTRAL;
        }
        let mean = (sums[0] + sums[1] + sums[2]) / 3.0;
        Self { gains: sums.map(|sum| (mean / sum).clamp(*GAIN_RANGE.start(), *GAIN_RANGE.end())) }
    }

    fn apply(&self, pixel: [u8; 3]) -> [f32; 3] {
        let [r, g, b] = pixel.map(f32::from);
        [r * self.gains[0], g * self.gains[1], b * self.gains[2]]
    }
}

/// What paint a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Paint {
    /// The dangerous object's red.
    Red,
    /// A landmark's colour.
    Landmark(Colour),
}

impl Paint {
    /// The paint of a pixel and how pure it is (0 to 1); `None` for grey, dark and in-between.
    pub fn of(pixel: [u8; 3], balance: &Balance) -> Option<(Self, f32)> {
        let [r, g, b] = balance.apply(pixel);
        let (high, low) = (r.max(g).max(b), r.min(g).min(b));
        let spread = high - low;
        if high < DARK || spread < 0.4 * high {
            return None;
        }
        let hue = hue_degrees([r, g, b], high, spread);
        if !(16.0..=344.0).contains(&hue) {
            // The larger of green and blue: what orange, pink and brown have too much of.
            let purity = (r - g.max(b)) / r;
            return (purity > 0.5).then_some((Self::Red, purity));
        }
        let colour =
            Colour::ALL.into_iter().find(|colour| (hue - colour.hue_degrees()).abs() < 24.0)?;
        Some((Self::Landmark(colour), spread / high))
    }
}

/// Hue of a colour whose largest part and spread (more than 0) are known, in [0, 360).
fn hue_degrees([r, g, b]: [f32; 3], high: f32, spread: f32) -> f32 {
    let sixth = if high <= r {
        ((g - b) / spread).rem_euclid(6.0)
    } else if high <= g {
        (b - r) / spread + 2.0
    } else {
        (r - g) / spread + 4.0
    };
    sixth * 60.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paint(pixel: [u8; 3]) -> Option<Paint> {
        Paint::of(pixel, &Balance::NEUTRAL).map(|(paint, _)| paint)
    }

    #[test]
    fn red_is_red_in_any_light_and_its_neighbours_are_not() {
        for red in [[220, 20, 18], [60, 6, 5], [200, 25, 10], [180, 10, 30]] {
            assert_eq!(paint(red), Some(Paint::Red), "{red:?}");
        }
        for other in [[255, 140, 0], [139, 69, 19], [255, 105, 180], [220, 160, 140], [12, 1, 1]] {
            assert_ne!(paint(other), Some(Paint::Red), "{other:?}");
        }
    }

    #[test]
    fn landmarks_have_their_own_paint() {
        for colour in Colour::ALL {
            let on = |share: f32| if share > 0.5 { 190 } else { 15 };
            assert_eq!(paint(colour.albedo().map(on)), Some(Paint::Landmark(colour)));
        }
    }

    #[test]
    fn a_reddish_lamp_does_not_make_grey_things_red() {
        let mut rgb: Vec<u8> = [120, 95, 92].repeat(500);
        rgb.extend([180, 6, 5].repeat(20));
        let view = View::new(52, 10, &rgb).unwrap();

        let balance = Balance::of(&view);

        assert!(balance.gains[0] < 0.9 && balance.gains[2] > 1.05, "{balance:?}");
        assert_eq!(Paint::of([120, 95, 92], &balance), None);
        assert_eq!(Paint::of([180, 6, 5], &balance).map(|p| p.0), Some(Paint::Red));
    }
}
