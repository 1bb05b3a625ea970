//! The area where the rover may be.

/// Most corners of an area.
const CORNERS_MAX: usize = 1000;
/// On the edge is inside, metres.
const EDGE_M: f64 = 1e-9;

/// A polygon without holes; its edge belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Area {
    corners: Vec<[f64; 2]>,
}

/// Corners that make no area.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AreaError {
    /// Too few or too many.
    #[error("area has {found} corners, allowed are 3 to 1000")]
    Corners {
        /// How many.
        found: usize,
    },
    /// Not a number.
    #[error("area: corner {index} is [{x}, {y}], both must be finite")]
    NotFinite {
        /// Which corner, from 0.
        index: usize,
        /// As found.
        x: f64,
        /// As found.
        y: f64,
    },
    /// All corners on one line.
    #[error("area is empty: its corners lie on one line")]
    Empty,
}

impl Area {
    /// A polygon by its corners in order, either way round.
    pub fn new(corners: Vec<[f64; 2]>) -> Result<Self, AreaError> {
        if !(3..=CORNERS_MAX).contains(&corners.len()) {
            return Err(AreaError::Corners { found: corners.len() });
        }
        let finite = |corner: &[f64; 2]| corner.iter().all(|value| value.is_finite());
        if let Some(index) = corners.iter().position(|corner| !finite(corner)) {
            let [x, y] = corners[index];
            return Err(AreaError::NotFinite { index, x, y });
        }
        let area = Self { corners };
        let flat = area.edges().all(|(a, b)| cross(area.corners[0], a, b).abs() < 1e-12);
        if flat { Err(AreaError::Empty) } else { Ok(area) }
    }

    /// Whether a point is inside or on the edge; nothing that is not a number is.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        if !(x.is_finite() && y.is_finite()) {
            return false;
        }
        let mut inside = false;
        for (a, b) in self.edges() {
            if distance_to_edge([x, y], a, b) <= EDGE_M {
                return true;
            }
            // A ray to the right crosses the edge: each crossing changes sides.
            if (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) {
                inside = !inside;
            }
        }
        inside
    }

    fn edges(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|(a, b)| (*a, *b))
    }
}

fn cross(o: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
}

fn distance_to_edge(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let square = dx * dx + dy * dy;
    let share = if square > 0.0 {
        (((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (p[0] - a[0] - share * dx).hypot(p[1] - a[1] - share * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demo_area_holds_the_tunnel_with_its_edge() {
        let corners = vec![[0.0, -2.0], [30.0, -2.0], [30.0, 2.0], [0.0, 2.0]];
        let area = Area::new(corners).unwrap();

        for (x, y) in [(15.0, 0.0), (0.0, -2.0), (30.0, 0.0), (12.0, 2.0)] {
            assert!(area.contains(x, y), "{x} {y}");
        }
        for (x, y) in [(-0.01, 0.0), (30.01, 0.0), (5.0, 2.01), (f64::NAN, 0.0)] {
            assert!(!area.contains(x, y), "{x} {y}");
        }
    }

    #[test]
    fn the_notch_of_an_l_is_outside_whichever_way_round() {
        let mut corners =
            vec![[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]];
        for _ in 0..2 {
            let area = Area::new(corners.clone()).unwrap();
            assert!(area.contains(1.0, 3.0) && area.contains(3.0, 1.0) && area.contains(2.0, 3.0));
            assert!(!area.contains(3.0, 3.0) && !area.contains(-1.0, 2.0));
            // A ray through a corner counts it once.
            assert!(area.contains(1.0, 2.0) && !area.contains(-1.0, 4.0));
            corners.reverse();
        }
    }

    #[test]
    fn corners_that_make_no_area_are_refused() {
        let flat = vec![[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]];
        assert_eq!(Area::new(vec![[0.0, 0.0]]), Err(AreaError::Corners { found: 1 }));
        assert_eq!(Area::new(flat), Err(AreaError::Empty));
        let infinite = Area::new(vec![[0.0, 0.0], [1.0, f64::INFINITY], [2.0, 0.0]]);
        assert!(matches!(infinite, Err(AreaError::NotFinite { index: 1, .. })));
    }
}
