//! Pictures of the tunnel: one ray a pixel, cast at walls, posts and the object.

use super::surface::{self, Hit};
use crate::cast::{byte, single};
use crate::optics::{Lens, Picture};
use crate::tunnel::{DangerousObject, LANDMARKS, Landmark, Pose};

/// Height of both cameras above the floor, metres.
pub const CAMERA_HEIGHT_M: f64 = 0.45;
/// Posts farther away than this are too dark and small to draw, metres.
const POST_RANGE_M: f64 = 14.0;
/// Half the spread of the sensor's noise, of 255.
const SENSOR_NOISE: f32 = 6.0;

/// What a picture shows: everything in the tunnel that is not always there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scene {
    /// Where the camera's rover is.
    pub pose: Pose,
    /// The red cube, when it is there.
    pub object: Option<DangerousObject>,
    /// Brightness of lamp and surroundings; 1 is usual, 0 is night.
    pub light: f32,
    /// Seeds the sensor's noise: equal scenes with equal seeds give equal bytes.
    pub seed: u64,
}

impl Scene {
    /// The usual light, nothing dangerous.
    pub fn at(pose: Pose) -> Self {
        Self { pose, object: None, light: 1.0, seed: 0 }
    }
}

/// A camera with its rays worked out once.
#[derive(Debug, Clone)]
pub struct Camera {
    width: usize,
    height: usize,
    lens: Lens,
    rays: Vec<Option<[f32; 3]>>,
}

impl Camera {
    /// A camera whose pictures have the given size.
    pub fn new(width: usize, height: usize, lens: Lens) -> Self {
        let size = (width, height);
        let ray = |index: usize| {
            let (column, row) = ((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
            lens.ray(size, column, row).map(|ray| ray.map(single))
        };
        Self { width, height, lens, rays: (0..width * height).map(ray).collect() }
    }

    /// The rovers' perspective camera: 160 x 120.
    pub fn perspective() -> Self {
        Self::new(160, 120, Lens::PERSPECTIVE)
    }

    /// The rovers' fisheye: 240 x 240.
    pub fn fisheye() -> Self {
        Self::new(240, 240, Lens::FISHEYE)
    }

    /// Draws the scene.
    pub fn render(&self, scene: &Scene) -> Picture {
        let eye = Eye::new(scene);
        let mut rgb = Vec::with_capacity(self.rays.len() * 3);
        let mut noise = seed_of(scene.seed);
        for ray in &self.rays {
            let colour = match ray {
                Some(ray) => eye.colour(*ray),
                None => [0.0; 3],
            };
            noise = step(noise);
            rgb.extend(exposed(colour, noise));
        }
        Picture { width: self.width, height: self.height, rgb }
    }

    /// Width and height of the pictures.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The lens.
    pub fn lens(&self) -> Lens {
        self.lens
    }
}

/// The scene as one camera position needs it.
struct Eye {
    x: f32,
    y: f32,
    sin: f32,
    cos: f32,
    posts: Vec<Landmark>,
    object: Option<DangerousObject>,
    light: f32,
}

impl Eye {
    fn new(scene: &Scene) -> Self {
        let Pose { x, y, yaw } = scene.pose;
        let near = |post: &&Landmark| scene.pose.distance_to(post.x, post.y) < POST_RANGE_M;
        Self {
            x: single(x),
            y: single(y),
            sin: single(yaw.sin()),
            cos: single(yaw.cos()),
            posts: LANDMARKS.iter().filter(near).copied().collect(),
            object: scene.object,
            light: scene.light,
        }
    }

    /// Light (0 to 1 and above) that comes from where a ray of the body frame ends.
    fn colour(&self, [ahead, left, up]: [f32; 3]) -> [f32; 3] {
        let direction =
            [self.cos * ahead - self.sin * left, self.sin * ahead + self.cos * left, up];
        let from = [self.x, self.y, single(CAMERA_HEIGHT_M)];
        let mut hit = surface::room(from, direction);
        for post in &self.posts {
            hit = nearer(hit, surface::post(post, from, direction));
        }
        if let Some(object) = &self.object {
            hit = nearer(hit, surface::cube(object, from, direction));
        }
        let ratio = hit.distance / 5.0;
        let light = self.light * (0.12 + 0.88 / (1.0 + ratio * ratio)) * hit.shade;
        hit.albedo.map(|share| share * light)
    }
}

fn nearer(hit: Hit, other: Option<Hit>) -> Hit {
    match other {
        Some(other) if other.distance < hit.distance => other,
        Some(_) | None => hit,
    }
}

/// Bytes of a pixel: gain, sensor noise (luma and chroma), cut off at 0 and 255.
fn exposed(colour: [f32; 3], noise: u32) -> [u8; 3] {
    let [luma, red, green, blue] = noise.to_le_bytes().map(|part| f32::from(part) / 127.5 - 1.0);
    let [r, g, b] = colour;
    let pixel = |share: f32, chroma: f32| {
        byte(share * 245.0 + SENSOR_NOISE * (0.6 * luma + 0.4 * chroma) + 2.0)
    };
    [pixel(r, red), pixel(g, green), pixel(b, blue)]
}

/// The noise has 32 bits of state; both halves of the seed count, and 0 would be stuck.
fn seed_of(seed: u64) -> u32 {
    let [a, b, c, d, e, f, g, h] = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).to_le_bytes();
    (u32::from_le_bytes([a, b, c, d]) ^ u32::from_le_bytes([e, f, g, h])) | 1
}

/// One step of xorshift: a few operations, since every pixel pays for it.
fn step(mut state: u32) -> u32 {
    state ^= state << 13;
    state ^= state >> 17;
    state ^ (state << 5)
}

#[cfg(test)]
mod tests {
    use super::{Camera, Scene};
    use crate::tunnel::{DangerousObject, Pose};

    #[test]
    fn equal_scenes_give_equal_bytes_and_other_seeds_other_noise() {
        let camera = Camera::perspective();
        let scene = Scene::at(Pose::new(3.0, 0.2, 0.1));

        let picture = camera.render(&scene);

        assert_eq!(picture.rgb.len(), 160 * 120 * 3);
        assert_eq!(picture, camera.render(&scene));
        assert_ne!(picture, camera.render(&Scene { seed: 1, ..scene }));
    }

    #[test]
    fn the_object_is_red_where_the_lens_says_it_is() {
        for camera in [Camera::fisheye(), Camera::perspective()] {
            let object = DangerousObject::at(8.0, 0.3);
            let scene = Scene { object: Some(object), ..Scene::at(Pose::new(5.0, 0.0, 0.0)) };
            let direction = [8.0 - 0.3 - 5.0, 0.3, 0.3 - super::CAMERA_HEIGHT_M];
            let (column, row) = camera.lens().pixel(camera.size(), direction).unwrap();

            let picture = camera.render(&scene);

            let at = (crate::cast::rounded(row - 0.5), crate::cast::rounded(column - 0.5));
            let index = usize::try_from(at.0 * picture.width as i64 + at.1).unwrap() * 3;
            let [r, g, b] = [0, 1, 2].map(|part| i32::from(picture.rgb[index + part]));
            assert!(r > 100 && g < 60 && b < 60, "{r} {g} {b}");
        }
    }

    #[test]
    fn the_picture_fades_with_the_light() {
        let camera = Camera::perspective();
        let scene = Scene::at(Pose::new(3.0, 0.0, 0.0));
        let sum = |light| {
            let picture = camera.render(&Scene { light, ..scene });
            picture.rgb.iter().map(|&value| u64::from(value)).sum::<u64>()
        };

        assert!(sum(1.0) > 2 * sum(0.3));
        assert!(sum(0.0) < 160 * 120 * 3 * 8);
    }
}
