//! Landmarks: posts of two colours, one above the other.

use sdr_lab::optics::Lens;
use sdr_lab::tunnel::{Colour, Landmark, landmark_by_colours};

use super::View;
use super::blobs::{Blob, blobs};
use super::paint::{Balance, Paint};

/// A colour of a post must have at least so many pixels.
const AREA_MIN: usize = 8;
/// And so many rows.
const HEIGHT_MIN: usize = 4;
/// Rows that may lie between the colours: mixed pixels have neither.
const SEAM_MAX: usize = 2;
/// How well the middle of a post is known, pixels.
const COLUMN_SIGMA: f64 = 0.6;

/// A landmark seen in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Which one, by the map.
    pub landmark: Landmark,
    /// Angle to it, radians, positive to the left.
    pub bearing: f64,
    /// Standard deviation of the angle, radians.
    pub sigma: f64,
}

/// All posts of the map that a picture shows whole enough to name, from left to right.
pub fn find_landmarks(view: &View<'_>, lens: &Lens) -> Vec<Sighting> {
    let balance = Balance::of(view);
    let size = view.size();
    let labels: Vec<u8> = view
        .pixels()
        .map(|pixel| match Paint::of(pixel, &balance) {
            Some((Paint::Landmark(colour), _)) => label_of(colour),
            Some((Paint::Red, _)) | None => 0,
        })
        .collect();
    let tall = |blob: &Blob| blob.area >= AREA_MIN && blob.height() >= HEIGHT_MIN;
    // A post cut off by the edge of the picture has its middle elsewhere.
    let whole = |blob: &Blob| blob.left > 0 && blob.right + 1 < size.0;
    let parts: Vec<Blob> =
        blobs(&labels, size.0).into_iter().filter(|blob| tall(blob) && whole(blob)).collect();
    let mut sightings: Vec<Sighting> = Vec::new();
    for upper in &parts {
        for lower in parts.iter().filter(|lower| is_below(upper, lower)) {
            sightings.extend(sighting(upper, lower, size, lens));
        }
    }
    sightings.sort_by(|one, two| two.bearing.total_cmp(&one.bearing));
    sightings
}

/// Whether two blobs can be the halves of one post.
fn is_below(upper: &Blob, lower: &Blob) -> bool {
    let seam = lower.top.abs_diff(upper.bottom + 1);
    let apart = (upper.centre().0 - lower.centre().0).abs();
    let wide = upper.width().max(lower.width()) as f64;
    let narrow = upper.width().min(lower.width()) as f64;
    lower.label != upper.label
        && lower.top > upper.top
        && seam <= SEAM_MAX
        && apart <= (0.2 * wide).max(0.9)
        && narrow + 2.0 >= 0.6 * wide
}

fn sighting(upper: &Blob, lower: &Blob, size: (usize, usize), lens: &Lens) -> Option<Sighting> {
    let landmark = landmark_by_colours(colour_of(upper.label)?, colour_of(lower.label)?)?;
    let (upper_column, _) = upper.centre();
    let (lower_column, lower_row) = lower.centre();
    let column = (upper_column + lower_column) / 2.0;
    let bearing = lens.bearing(size, column, lower_row)?;
    let beside = lens.bearing(size, column - COLUMN_SIGMA, lower_row)?;
    Some(Sighting { landmark: *landmark, bearing, sigma: (beside - bearing).abs() })
}

fn label_of(colour: Colour) -> u8 {
    match colour {
        Colour::Yellow => 1,
        Colour::Green => 2,
        Colour::Cyan => 3,
        Colour::Blue => 4,
        Colour::Magenta => 5,
    }
}

fn colour_of(label: u8) -> Option<Colour> {
    Colour::ALL.into_iter().find(|colour| label_of(*colour) == label)
}

#[cfg(test)]
mod tests {
    use sdr_lab::noise::Noise;
    use sdr_lab::tunnel::{DangerousObject, Pose};
    use sdr_lab::world::{Camera, Scene};

    use super::*;

    #[test]
    fn posts_are_named_rightly_and_their_bearings_are_true() {
        let camera = Camera::perspective();
        let mut noise = Noise::new(21);
        let mut seen = 0;
        for seed in 0..80 {
            let turned = if seed % 2 == 0 { 0.0 } else { std::f64::consts::PI };
            let pose = Pose::new(
                3.0 + 24.0 * noise.uniform(),
                2.0 * noise.uniform() - 1.0,
                turned + 0.6 * noise.uniform() - 0.3,
            );
            let picture = camera.render(&Scene { seed, ..Scene::at(pose) });

            let found = find_landmarks(&View::try_from(&picture).unwrap(), &camera.lens());

            seen += found.len();
            for sighting in found {
                let truth = pose.bearing_to(sighting.landmark.x, sighting.landmark.y);
                let error = sighting.bearing - truth;
                assert!(error.abs() < 0.025, "{error} for {sighting:?} at {pose:?}");
            }
        }
        assert!(seen > 120, "only {seen} sightings in 80 pictures");
    }

    #[test]
    fn the_red_box_is_no_landmark_and_darkness_has_none() {
        let camera = Camera::perspective();
        let object = Some(DangerousObject::at(7.0, 0.0));
        let scene = Scene { object, ..Scene::at(Pose::new(5.0, 0.0, 0.0)) };
        let find = |scene: &Scene| {
            find_landmarks(&View::try_from(&camera.render(scene)).unwrap(), &camera.lens())
        };

        assert!(find(&scene).iter().all(|s| s.landmark.x > 5.0));
        assert!(find(&Scene { light: 0.0, ..scene }).is_empty());
    }
}
