//! What cameras see: the dangerous object and the landmarks.
//!
//! Classical vision: each pixel gets a paint from its chromaticity, which light does not
//! change; joined pixels make blobs; the shape of blobs decides.

mod blobs;
mod danger;
mod landmarks;
mod paint;

use sdr_lab::optics::Picture;

pub use blobs::{Blob, blobs};
pub use danger::{Detection, Vote, find_red_box};
pub use landmarks::{Sighting, find_landmarks};
pub use paint::{Balance, Paint};

/// Most pixels of a picture: 16 million.
pub const PIXELS_MAX: usize = 16 << 20;

/// A picture of 8-bit red, green, blue that somebody else holds.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    width: usize,
    height: usize,
    rgb: &'a [u8],
}

impl<'a> View<'a> {
    /// A picture without gaps between its rows.
    pub fn new(width: usize, height: usize, rgb: &'a [u8]) -> Result<Self, ViewError> {
        let pixels = width.saturating_mul(height);
        if pixels == 0 || pixels > PIXELS_MAX {
            return Err(ViewError::Size { width, height });
        }
        if rgb.len() != pixels * 3 {
            return Err(ViewError::Bytes { found: rgb.len(), wanted: pixels * 3 });
        }
        Ok(Self { width, height, rgb })
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// All pixels, row by row from the top.
    pub fn pixels(&self) -> impl Iterator<Item = [u8; 3]> + 'a {
        let (pixels, _) = self.rgb.as_chunks::<3>();
        pixels.iter().copied()
    }
}

impl<'a> TryFrom<&'a Picture> for View<'a> {
    type Error = ViewError;

    fn try_from(picture: &'a Picture) -> Result<Self, ViewError> {
        View::new(picture.width, picture.height, &picture.rgb)
    }
}

/// Bytes that are no picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ViewError {
    /// Empty, or too large.
    #[error("picture of {width} x {height}, allowed are 1 to 16777216 pixels")]
    Size {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// Not three bytes a pixel.
    #[error("picture has {found} bytes, its size wants {wanted}")]
    Bytes {
        /// Bytes there are.
        found: usize,
        /// Bytes there should be.
        wanted: usize,
    },
}

/// 0 up to `low`, 1 from `high` on, a straight line between.
fn ramp(value: f64, low: f64, high: f64) -> f64 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::{View, ViewError};

    #[test]
    fn bytes_that_do_not_fit_the_size_are_refused() {
        assert_eq!(
            View::new(2, 2, &[0; 11]).unwrap_err(),
            ViewError::Bytes { found: 11, wanted: 12 }
        );
        assert_eq!(View::new(0, 2, &[]).unwrap_err(), ViewError::Size { width: 0, height: 2 });
        assert!(View::new(usize::MAX, 2, &[]).is_err());
        assert_eq!(View::new(2, 2, &[7; 12]).unwrap().pixels().count(), 4);
    }
}
