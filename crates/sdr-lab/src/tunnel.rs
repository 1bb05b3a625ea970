//! The place: a straight tunnel with coloured posts along its walls.
//!
//! Frame: x along the tunnel (0 to 30 m), y to the left (-2 to 2 m), z up, yaw from x to y.

use serde::{Deserialize, Serialize};

/// Length of the tunnel, metres; x goes from 0 to here.
pub const LENGTH_M: f64 = 30.0;
/// From the centre line to each wall, metres.
pub const HALF_WIDTH_M: f64 = 2.0;
/// From floor to ceiling, metres.
pub const HEIGHT_M: f64 = 2.6;
/// Radius of a landmark post, metres.
pub const POST_RADIUS_M: f64 = 0.14;
/// Height of a landmark post, metres; the colours meet half way up.
pub const POST_HEIGHT_M: f64 = 1.6;

/// Where the leader of a convoy starts: in the right lane, looking along the tunnel.
pub const START: Pose = Pose { x: 1.5, y: -0.8, yaw: 0.0 };

/// Where something is and where it looks.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Pose {
    /// Along the tunnel, metres.
    pub x: f64,
    /// To the left of the centre line, metres.
    pub y: f64,
    /// Heading, radians, in (-pi, pi]; 0 looks along the tunnel.
    pub yaw: f64,
}

impl Pose {
    /// A pose; `yaw` is brought into (-pi, pi].
    pub fn new(x: f64, y: f64, yaw: f64) -> Self {
        Self { x, y, yaw: wrap_angle(yaw) }
    }

    /// The pose that lies at `offset` in the frame of `self`.
    pub fn at_offset(&self, offset: &Self) -> Self {
        let (sin, cos) = self.yaw.sin_cos();
        Self::new(
            self.x + cos * offset.x - sin * offset.y,
            self.y + sin * offset.x + cos * offset.y,
            self.yaw + offset.yaw,
        )
    }

    /// Metres to a point.
    pub fn distance_to(&self, x: f64, y: f64) -> f64 {
        (x - self.x).hypot(y - self.y)
    }

    /// Angle to a point seen from here, radians, positive to the left.
    pub fn bearing_to(&self, x: f64, y: f64) -> f64 {
        wrap_angle((y - self.y).atan2(x - self.x) - self.yaw)
    }
}

/// The same angle in (-pi, pi].
pub fn wrap_angle(angle: f64) -> f64 {
    let wrapped = angle.rem_euclid(std::f64::consts::TAU);
    if wrapped > std::f64::consts::PI { wrapped - std::f64::consts::TAU } else { wrapped }
}

/// The colours of landmarks: saturated, 60 degrees of hue apart, none of them red.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Colour {
    /// Hue 60 degrees.
    Yellow,
    /// Hue 120 degrees.
    Green,
    /// Hue 180 degrees.
    Cyan,
    /// Hue 240 degrees.
    Blue,
    /// Hue 300 degrees.
    Magenta,
}

impl Colour {
    /// All of them, by hue.
    pub const ALL: [Self; 5] = [Self::Yellow, Self::Green, Self::Cyan, Self::Blue, Self::Magenta];

    /// Hue in degrees.
    pub fn hue_degrees(self) -> f32 {
        match self {
            Self::Yellow => 60.0,
            Self::Green => 120.0,
            Self::Cyan => 180.0,
            Self::Blue => 240.0,
            Self::Magenta => 300.0,
        }
    }

    /// Share of red, green and blue light that the paint returns.
    pub fn albedo(self) -> [f32; 3] {
        match self {
            Self::Yellow => [0.82, 0.80, 0.06],
            Self::Green => [0.06, 0.78, 0.08],
            Self::Cyan => [0.06, 0.78, 0.80],
            Self::Blue => [0.07, 0.09, 0.85],
            Self::Magenta => [0.82, 0.07, 0.80],
        }
    }
}

/// A post at a known place; its two colours from top to bottom are its name.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Landmark {
    /// Number in the map, from 0.
    pub id: u8,
    /// Along the tunnel, metres.
    pub x: f64,
    /// To the left of the centre line, metres.
    pub y: f64,
    /// Colour of the upper half.
    pub upper: Colour,
    /// Colour of the lower half.
    pub lower: Colour,
}

/// The map: every (upper, lower) pair occurs once.
pub const LANDMARKS: [Landmark; 14] = {
    use Colour::{Blue, Cyan, Green, Magenta, Yellow};
    [
        post(0, 0.3, -1.2, Blue, Yellow),
        post(1, 0.3, 1.2, Yellow, Blue),
        post(2, 4.0, 1.8, Green, Magenta),
        post(3, 6.5, -1.8, Magenta, Green),
        post(4, 9.0, 1.8, Cyan, Yellow),
        post(5, 11.5, -1.8, Yellow, Cyan),
        post(6, 14.0, 1.8, Blue, Green),
        post(7, 16.5, -1.8, Green, Blue),
        post(8, 19.0, 1.8, Magenta, Yellow),
        post(9, 21.5, -1.8, Yellow, Magenta),
        post(10, 24.0, 1.8, Magenta, Cyan),
        post(11, 26.5, -1.8, Cyan, Magenta),
        post(12, 29.7, 1.2, Green, Yellow),
        post(13, 29.7, -1.2, Yellow, Green),
    ]
};

const fn post(id: u8, x: f64, y: f64, upper: Colour, lower: Colour) -> Landmark {
    Landmark { id, x, y, upper, lower }
}

/// The landmark with these colours, if the map has one.
pub fn landmark_by_colours(upper: Colour, lower: Colour) -> Option<&'static Landmark> {
    LANDMARKS.iter().find(|post| post.upper == upper && post.lower == lower)
}

/// The dangerous object: a red cube standing on the floor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DangerousObject {
    /// Centre along the tunnel, metres.
    pub x: f64,
    /// Centre to the left of the centre line, metres.
    pub y: f64,
    /// Length of an edge, metres.
    pub edge_m: f64,
}

impl DangerousObject {
    /// The usual size, 0.6 m.
    pub const EDGE_M: f64 = 0.6;

    /// A cube of the usual size.
    pub fn at(x: f64, y: f64) -> Self {
        Self { x, y, edge_m: Self::EDGE_M }
    }

    /// Whether a disc of `radius` metres about (x, y) touches the cube.
    pub fn touches(&self, x: f64, y: f64, radius: f64) -> bool {
        let half = self.edge_m / 2.0;
        let beside = ((x - self.x).abs() - half).max(0.0);
        let across = ((y - self.y).abs() - half).max(0.0);
        beside.hypot(across) < radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_of_colours_names_one_post() {
        for post in &LANDMARKS {
            assert_ne!(post.upper, post.lower, "post {}", post.id);
            assert_eq!(landmark_by_colours(post.upper, post.lower), Some(post));
            assert!(post.x > 0.0 && post.x < LENGTH_M && post.y.abs() < HALF_WIDTH_M);
        }
    }

    #[test]
    fn an_offset_turns_with_the_pose() {
        let pose = Pose::new(1.0, 2.0, std::f64::consts::FRAC_PI_2);

        let beside = pose.at_offset(&Pose::new(1.0, 0.5, 0.0));

        assert!((beside.x - 0.5).abs() < 1e-12 && (beside.y - 3.0).abs() < 1e-12);
        assert!((pose.bearing_to(0.0, 2.0) - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn a_disc_touches_the_cube_at_its_corner_only_when_near() {
        let cube = DangerousObject::at(5.0, 0.0);

        assert!(cube.touches(4.6, 0.0, 0.15));
        assert!(!cube.touches(4.6, 0.4, 0.12));
    }
}
