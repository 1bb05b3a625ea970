//! Lenses and pictures: which way a pixel looks.
//!
//! Body frame: x ahead, y to the left, z up. Pixel (0, 0) is the upper left one; its centre
//! is at (0.5, 0.5).

use serde::{Deserialize, Serialize};

/// A picture of 8-bit red, green, blue, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Picture {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `3 * width * height` bytes.
    pub rgb: Vec<u8>,
}

/// How a camera maps directions to pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Lens {
    /// A pinhole; the angle is that of the picture's full width, radians.
    Perspective {
        /// Horizontal field of view, radians, less than pi.
        hfov_rad: f64,
    },
    /// Equidistant: the angle from the axis grows with the distance from the picture's centre
    /// and reaches half the field of view at the nearer edge.
    Fisheye {
        /// Field of view, radians.
        fov_rad: f64,
    },
}

impl Lens {
    /// The perspective camera of the rovers: 70 degrees.
    pub const PERSPECTIVE: Self =
        Self::Perspective { hfov_rad: 70.0 / 180.0 * std::f64::consts::PI };
    /// The fisheye of the rovers: 180 degrees.
    pub const FISHEYE: Self = Self::Fisheye { fov_rad: std::f64::consts::PI };

    /// The direction (unit vector, body frame) that a point of a picture of the given size
    /// shows; `None` outside the image circle of a fisheye.
    pub fn ray(&self, size: (usize, usize), column: f64, row: f64) -> Option<[f64; 3]> {
        let (width, height) = (size.0 as f64, size.1 as f64);
        let right = column - width / 2.0;
        let down = row - height / 2.0;
        match *self {
            Self::Perspective { hfov_rad } => {
                let focal = width / 2.0 / (hfov_rad / 2.0).tan();
                let length = (focal * focal + right * right + down * down).sqrt();
                Some([focal / length, -right / length, -down / length])
            }
            Self::Fisheye { fov_rad } => {
                let radius = width.min(height) / 2.0;
                let distance = right.hypot(down);
                if distance > radius {
                    return None;
                }
                let angle = distance / radius * fov_rad / 2.0;
                let share = if distance > 0.0 { angle.sin() / distance } else { 0.0 };
                Some([angle.cos(), -right * share, -down * share])
            }
        }
    }

    /// Horizontal angle of a point of the picture, radians, positive to the left.
    pub fn bearing(&self, size: (usize, usize), column: f64, row: f64) -> Option<f64> {
        self.ray(size, column, row).map(|[x, y, _]| y.atan2(x))
    }

    /// The point of the picture that shows a direction of the body frame; `None` when the
    /// lens does not see it.
    pub fn pixel(&self, size: (usize, usize), direction: [f64; 3]) -> Option<(f64, f64)> {
        let (width, height) = (size.0 as f64, size.1 as f64);
        let [x, y, z] = direction;
        let (right, down) = match *self {
            Self::Perspective { hfov_rad } => {
                if x <= 0.0 {
                    return None;
                }
                let focal = width / 2.0 / (hfov_rad / 2.0).tan();
                (-y / x * focal, -z / x * focal)
            }
            Self::Fisheye { fov_rad } => {
                let side = y.hypot(z);
                let angle = side.atan2(x);
                if angle > fov_rad / 2.0 {
                    return None;
                }
                let radius = angle / (fov_rad / 2.0) * width.min(height) / 2.0;
                let share = if side > 0.0 { radius / side } else { 0.0 };
                (-y * share, -z * share)
            }
        };
        let (column, row) = (width / 2.0 + right, height / 2.0 + down);
        let inside = (0.0..=width).contains(&column) && (0.0..=height).contains(&row);
        inside.then_some((column, row))
    }
}

#[cfg(test)]
mod tests {
    use super::Lens;

    #[test]
    fn a_pixel_and_its_ray_belong_together() {
        for (lens, size) in [(Lens::PERSPECTIVE, (160, 120)), (Lens::FISHEYE, (240, 240))] {
            for (column, row) in [(80.0, 60.0), (100.5, 44.0), (61.0, 100.0), (80.5, 50.5)] {
                let ray = lens.ray(size, column, row).unwrap();
                let (c, r) = lens.pixel(size, ray).unwrap();
                assert!((c - column).abs() < 1e-9 && (r - row).abs() < 1e-9, "{lens:?} {c} {r}");
            }
        }
    }

    #[test]
    fn the_left_edge_of_the_perspective_picture_is_at_35_degrees() {
        let bearing = Lens::PERSPECTIVE.bearing((160, 120), 0.0, 60.0).unwrap();

        assert!((bearing.to_degrees() - 35.0).abs() < 1e-9);
        assert!(Lens::FISHEYE.ray((240, 240), 5.0, 5.0).is_none());
    }
}
