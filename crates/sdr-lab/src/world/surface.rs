//! Where rays end: floor, walls, posts and the cube, with their paint and shading.

use crate::cast::{cell, single};
use crate::tunnel::{
    DangerousObject, HALF_WIDTH_M, HEIGHT_M, LENGTH_M, Landmark, POST_HEIGHT_M, POST_RADIUS_M,
};

/// The end of a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Metres from the eye (the direction has length one).
    pub(super) distance: f32,
    /// Share of red, green and blue light returned.
    pub(super) albedo: [f32; 3],
    /// Share of the lamp's light that the slant of the surface leaves.
    pub(super) shade: f32,
}

const WALL: [f32; 3] = [0.46, 0.43, 0.40];
const FLOOR: [f32; 3] = [0.36, 0.34, 0.31];
const CEILING: [f32; 3] = [0.30, 0.29, 0.28];
const OBJECT: [f32; 3] = [0.86, 0.07, 0.06];

/// The tunnel itself, seen from inside: always hit.
pub(super) fn room(from: [f32; 3], direction: [f32; 3]) -> Hit {
    let along = reach(from[0], direction[0], 0.0, single(LENGTH_M));
    let across = reach(from[1], direction[1], single(-HALF_WIDTH_M), single(HALF_WIDTH_M));
    let up = reach(from[2], direction[2], 0.0, single(HEIGHT_M));
    let distance = along.min(across).min(up);
    let end = [0, 1, 2].map(|axis| from[axis] + distance * direction[axis]);
    let (albedo, slant, u, v) = if up <= along && up <= across {
        let paint = if direction[2] > 0.0 { CEILING } else { FLOOR };
        (paint, direction[2], end[0], end[1])
    } else if across <= along {
        (WALL, direction[1], end[0], end[2])
    } else {
        (WALL, direction[0], end[1], end[2])
    };
    let rough = 1.0 + 0.28 * (grain(u, v, 2.5) - 0.5) + 0.18 * (grain(u, v, 12.0) - 0.5);
    Hit { distance, albedo: albedo.map(|share| share * rough), shade: shade(slant) }
}

/// Metres along a ray until it leaves the space between two parallel planes.
fn reach(from: f32, slope: f32, low: f32, high: f32) -> f32 {
    let room = if slope > 0.0 { high - from } else { from - low };
    // A ray along the planes never reaches them: x / 0 is infinite, since room is positive.
    room.max(1e-3) / slope.abs()
}

/// Roughness of rock: a fixed number in [0, 1) for each cell of the surface.
fn grain(u: f32, v: f32, cells_per_metre: f32) -> f32 {
    let column = cell(u * cells_per_metre).cast_unsigned();
    let row = cell(v * cells_per_metre).cast_unsigned();
    let mixed = column.wrapping_mul(0x9e37_79b1) ^ row.wrapping_mul(0x85eb_ca6b);
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x2c1b_3c6d);
    (mixed >> 16 & 0xff) as f32 / 256.0
}

/// Light left by the angle between ray and surface.
fn shade(slant: f32) -> f32 {
    0.35 + 0.65 * slant.abs().sqrt()
}

/// A post, if the ray meets it.
pub(super) fn post(post: &Landmark, from: [f32; 3], direction: [f32; 3]) -> Option<Hit> {
    let (x, y) = (single(post.x) - from[0], single(post.y) - from[1]);
    let along = x * direction[0] + y * direction[1];
    let flat = direction[0] * direction[0] + direction[1] * direction[1];
    let radius = single(POST_RADIUS_M);
    let beside = x * direction[1] - y * direction[0];
    if along <= 0.0 || beside * beside > radius * radius * flat {
        return None;
    }
    let inside = (radius * radius * flat - beside * beside).sqrt();
    let distance = (along - inside) / flat;
    let height = from[2] + distance * direction[2];
    if distance <= 0.0 || !(0.0..single(POST_HEIGHT_M)).contains(&height) {
        return None;
    }
    let colour = if height > single(POST_HEIGHT_M) / 2.0 { post.upper } else { post.lower };
    let slant = inside / (radius * flat.sqrt());
    Some(Hit { distance, albedo: colour.albedo(), shade: shade(slant) })
}

/// The cube, if the ray meets it.
pub(super) fn cube(object: &DangerousObject, from: [f32; 3], direction: [f32; 3]) -> Option<Hit> {
    let half = single(object.edge_m / 2.0);
    let (x, y) = (single(object.x), single(object.y));
    let low = [x - half, y - half, 0.0];
    let high = [x + half, y + half, half * 2.0];
    let (mut enter, mut leave, mut face) = (0.0_f32, f32::INFINITY, 0);
    for axis in 0..3 {
        // A ray along a face divides by zero: the slab is then all or nothing, as min and max
        // of infinities give it.
        let one = (low[axis] - from[axis]) / direction[axis];
        let two = (high[axis] - from[axis]) / direction[axis];
        if one.min(two) > enter {
            enter = one.min(two);
            face = axis;
        }
        leave = leave.min(one.max(two));
    }
    let hit = enter > 0.0 && enter < leave;
    hit.then(|| Hit { distance: enter, albedo: OBJECT, shade: shade(direction[face]) })
}
