//! A pose from one picture alone, for when nothing is known.

use sdr_lab::tunnel::{HALF_WIDTH_M, LENGTH_M, Pose, wrap_angle};

use crate::vision::Sighting;

/// Fewer posts leave more than one answer.
const SIGHTINGS_MIN: usize = 3;
/// Mesh of the first search, metres.
const MESH_M: f64 = 0.5;
/// The search ends at this mesh, metres.
const FINE_M: f64 = 0.005;
/// Root mean square of what the bearings may miss, radians.
const MISS_MAX_RAD: f64 = 0.03;
/// An answer elsewhere is one at least this far away, metres.
const ELSEWHERE_M: f64 = 1.5;
/// Its miss must be so many times larger, or nothing is sure.
const CLEARLY: f64 = 3.0;
/// Answers that are followed to their best.
const CANDIDATES: usize = 24;

/// The one pose in the tunnel that explains all bearings; `None` with fewer than three posts,
/// when nothing fits, or when two places fit alike.
pub fn locate(sightings: &[Sighting]) -> Option<Pose> {
    if sightings.len() < SIGHTINGS_MIN {
        return None;
    }
    let mut answers: Vec<Answer> = mesh().map(|(x, y)| Answer::at(x, y, sightings)).collect();
    answers.sort_by(|one, two| one.miss.total_cmp(&two.miss));
    answers.truncate(CANDIDATES);
    for answer in &mut answers {
        *answer = answer.refined(sightings);
    }
    answers.sort_by(|one, two| one.miss.total_cmp(&two.miss));
    let best = *answers.first().filter(|best| best.miss <= MISS_MAX_RAD)?;
    let elsewhere =
        |answer: &&Answer| best.pose.distance_to(answer.pose.x, answer.pose.y) >= ELSEWHERE_M;
    let doubtful = answers
        .iter()
        .find(elsewhere)
        .is_some_and(|other| other.miss < CLEARLY * best.miss.max(0.005));
    (!doubtful).then_some(best.pose)
}

fn mesh() -> impl Iterator<Item = (f64, f64)> {
    let line = |from: f64, to: f64| {
        std::iter::successors(Some(from), move |at| Some(at + MESH_M).filter(|at| *at <= to))
    };
    let rows = move || line(-HALF_WIDTH_M + 0.25, HALF_WIDTH_M - 0.25);
    line(0.25, LENGTH_M - 0.25).flat_map(move |x| rows().map(move |y| (x, y)))
}

/// A place, the heading that suits it best, and what the bearings then miss.
#[derive(Debug, Clone, Copy)]
struct Answer {
    pose: Pose,
    miss: f64,
}

impl Answer {
    fn at(x: f64, y: f64, sightings: &[Sighting]) -> Self {
        let headings = || {
            sightings
                .iter()
                .map(|seen| (seen.landmark.y - y).atan2(seen.landmark.x - x) - seen.bearing)
        };
        let (sin, cos) =
            headings().fold((0.0, 0.0), |(sin, cos), yaw| (sin + yaw.sin(), cos + yaw.cos()));
        let yaw = sin.atan2(cos);
        let square: f64 = headings().map(|heading| wrap_angle(heading - yaw).powi(2)).sum();
        let miss = (square / sightings.len() as f64).sqrt();
        Self { pose: Pose::new(x, y, yaw), miss }
    }

    /// Steps to better neighbours, halving the mesh when there is none.
    fn refined(&self, sightings: &[Sighting]) -> Self {
        let mut best = *self;
        let mut mesh = MESH_M / 2.0;
        while mesh > FINE_M {
            let Pose { x, y, .. } = best.pose;
            let steps = [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)];
            let around = steps.map(|(dx, dy)| Self::at(x + dx * mesh, y + dy * mesh, sightings));
            let better = around.into_iter().filter(|one| one.is_inside() && one.miss < best.miss);
            match better.min_by(|one, two| one.miss.total_cmp(&two.miss)) {
                Some(better) => best = better,
                None => mesh /= 2.0,
            }
        }
        best
    }

    fn is_inside(&self) -> bool {
        (0.0..=LENGTH_M).contains(&self.pose.x) && self.pose.y.abs() <= HALF_WIDTH_M
    }
}

#[cfg(test)]
mod tests {
    use sdr_lab::noise::Noise;
    use sdr_lab::world::{Camera, Scene};

    use super::*;
    use crate::vision::{View, find_landmarks};

    #[test]
    fn one_picture_tells_the_place_or_nothing_but_seldom_a_wrong_one() {
        let camera = Camera::perspective();
        let mut noise = Noise::new(31);
        let (mut found, mut wrong) = (0, 0);
        for seed in 0..100 {
            let turned = if seed % 2 == 0 { 0.0 } else { std::f64::consts::PI };
            let pose = Pose::new(
                2.0 + 26.0 * noise.uniform(),
                1.6 * noise.uniform() - 0.8,
                turned + noise.normal(0.1),
            );
            let picture = camera.render(&Scene { seed, ..Scene::at(pose) });
            let view = View::try_from(&picture).unwrap();

            let answer = locate(&find_landmarks(&view, &camera.lens()));

            if let Some(answer) = answer {
                found += 1;
                wrong += u32::from(pose.distance_to(answer.x, answer.y) > 0.5);
            }
        }
        assert!(found >= 30 && wrong <= 1, "found {found}, wrong {wrong}");
    }

    #[test]
    fn two_posts_are_not_enough() {
        let camera = Camera::perspective();
        let picture = camera.render(&Scene::at(Pose::new(5.0, 0.0, 0.0)));
        let view = View::try_from(&picture).unwrap();

        let sightings = find_landmarks(&view, &camera.lens());

        assert_eq!(locate(&sightings[..2]), None);
    }
}
