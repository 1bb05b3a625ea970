//! The dangerous object: a red box.

use sdr_lab::optics::Lens;

use super::blobs::{Blob, blobs};
use super::paint::{Balance, Paint};
use super::{View, ramp};

/// Fewer pixels than this are never an object.
const AREA_MIN: usize = 10;

/// Something that may be the dangerous object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// How surely it is one: 0 to 1. Colour, size, fill and shape must all agree.
    pub score: f64,
    /// The pixels.
    pub blob: Blob,
    /// Width and height of the picture.
    pub size: (usize, usize),
}

impl Detection {
    /// Angle to its middle, radians, positive to the left; `None` outside a fisheye's circle.
    pub fn bearing(&self, lens: &Lens) -> Option<f64> {
        let (column, row) = self.blob.centre();
        lens.bearing(self.size, column, row)
    }

    /// Rough distance if it stands on the floor and the lens is `height` metres above; `None`
    /// when its foot is not below the horizon.
    pub fn distance_m(&self, lens: &Lens, height: f64) -> Option<f64> {
        let (column, _) = self.blob.centre();
        let [x, y, z] = lens.ray(self.size, column, self.blob.bottom as f64 + 1.0)?;
        (z < -1e-3).then(|| height * x.hypot(y) / -z)
    }
}

/// The likeliest red box of a picture; `None` when nothing in it is red.
pub fn find_red_box(view: &View<'_>) -> Option<Detection> {
    let balance = Balance::of(view);
    let mut purities = Vec::with_capacity(view.size().0 * view.size().1);
    purities.extend(view.pixels().map(|pixel| match Paint::of(pixel, &balance) {
        Some((Paint::Red, purity)) => purity,
        Some((Paint::Landmark(_), _)) | None => 0.0,
    }));
    let labels: Vec<u8> = purities.iter().map(|&purity| u8::from(purity > 0.0)).collect();
    let size = view.size();
    let candidates = blobs(&labels, size.0).into_iter().filter(|blob| blob.area >= AREA_MIN);
    let rated =
        candidates.map(|blob| Detection { score: score(&blob, &purities, size), blob, size });
    rated.max_by(|one, two| one.score.total_cmp(&two.score).then(one.blob.area.cmp(&two.blob.area)))
}

/// Product of four opinions, each 0 to 1.
fn score(blob: &Blob, purities: &[f32], size: (usize, usize)) -> f64 {
    let area = blob.area as f64;
    let share = (area / (size.0 * size.1) as f64).sqrt();
    // A box of 0.6 m is 7 pixels wide in a fisheye of 240 at 7 m: share 0.027. Red light, or a
    // red wall, fills the picture.
    let big_enough = ramp(share, 0.012, 0.024);
    let small_enough = 1.0 - ramp(share, 0.8, 0.95);
    let fill = ramp(area / (blob.width() * blob.height()) as f64, 0.45, 0.68);
    let (width, height) = (blob.width() as f64, blob.height() as f64);
    let shape = ramp(width.min(height) / width.max(height), 0.25, 0.5);
    let pure = ramp(mean_purity(blob, purities, size.0), 0.55, 0.72);
    big_enough * small_enough * fill * shape * pure
}

/// Mean purity of the red pixels inside the blob's frame.
fn mean_purity(blob: &Blob, purities: &[f32], width: usize) -> f64 {
    let rows = (blob.top..=blob.bottom).map(|row| row * width);
    let red = rows
        .flat_map(|start| &purities[start + blob.left..=start + blob.right])
        .filter(|&&purity| purity > 0.0);
    let (sum, count) = red.fold((0.0, 0.0), |(sum, n), &p| (sum + f64::from(p), n + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

/// One picture may err: danger is what most of the last pictures say.
#[derive(Debug, Clone, Copy, Default)]
pub struct Vote {
    last: [bool; 3],
}

impl Vote {
    /// Takes one picture's opinion; whether at least two of the last three said danger.
    pub fn handle(&mut self, danger: bool) -> bool {
        self.last = [self.last[1], self.last[2], danger];
        self.last.iter().filter(|&&danger| danger).count() >= 2
    }
}

#[cfg(test)]
mod tests;
