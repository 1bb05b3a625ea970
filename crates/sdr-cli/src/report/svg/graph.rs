//! Robots as boxes, their components inside, connections as arrows: the paper's Figure 3.

use super::{Anchor, Svg, WIDTH};

const COLUMNS_MAX: usize = 3;
const BOX_WIDTH: f64 = 190.0;
const PART_HEIGHT: f64 = 38.0;
const PART_STEP: f64 = 62.0;
const HEAD: f64 = 34.0;
const MARGIN: f64 = 16.0;

/// A robot.
pub(crate) struct GraphBox {
    /// Its name.
    pub(crate) name: String,
    /// A second line, such as its role.
    pub(crate) note: String,
    /// Its components, and whether each came here by a move.
    pub(crate) parts: Vec<(String, bool)>,
}

/// A connection.
pub(crate) struct GraphEdge {
    /// The producer's name.
    pub(crate) from: String,
    /// The consumer's name.
    pub(crate) to: String,
    /// Its number in the list below.
    pub(crate) number: usize,
}

/// Robots, components, connections.
pub(crate) struct Graph {
    /// The robots, in order.
    pub(crate) boxes: Vec<GraphBox>,
    /// The connections.
    pub(crate) edges: Vec<GraphEdge>,
}

/// Where a component was drawn.
#[derive(Clone, Copy)]
struct Spot {
    robot: usize,
    column: usize,
    middle: (f64, f64),
}

impl Graph {
    /// Draws it; `label` says what it is to those who cannot see it.
    pub(crate) fn draw(&self, label: &str) -> String {
        let rows = self.boxes.chunks(COLUMNS_MAX);
        let heights: Vec<f64> = rows.clone().map(row_height).collect();
        let height = heights.iter().map(|height| height + MARGIN).sum::<f64>() + MARGIN;
        let mut svg = Svg::new(WIDTH, height.max(60.0), label);
        let mut spots = Vec::new();
        let mut top = MARGIN;
        for (row, (boxes, height)) in rows.zip(&heights).enumerate() {
            for (column, robot) in boxes.iter().enumerate() {
                let index = row * COLUMNS_MAX + column;
                let parts = robot.draw(&mut svg, (left_of(column), top), *height);
                spots.extend(
                    parts
                        .into_iter()
                        .map(|(name, middle)| (name, Spot { robot: index, column, middle })),
                );
            }
            top += height + MARGIN;
        }
        self.draw_edges(&mut svg, &spots);
        svg.finish()
    }

    fn draw_edges(&self, svg: &mut Svg, spots: &[(String, Spot)]) {
        let find = |name: &str| spots.iter().find(|spot| spot.0 == name).map(|spot| spot.1);
        let ends: Vec<_> =
            self.edges.iter().map(|edge| (find(&edge.from), find(&edge.to))).collect();
        let mut badges = Vec::new();
        for (index, (edge, (from, to))) in self.edges.iter().zip(&ends).enumerate() {
            let (Some(from), Some(to)) = (from, to) else { continue };
            // Two connections between the same two components go side by side.
            let twins = |other: &&(Option<Spot>, Option<Spot>)| {
                let (Some(a), Some(b)) = other else { return false };
                let same = |x: &Spot, y: &Spot| x.middle == y.middle;
                (same(a, from) && same(b, to)) || (same(a, to) && same(b, from))
            };
            let before = ends[..index].iter().filter(twins).count();
            let shift = if ends.iter().filter(twins).count() > 1 {
                if before % 2 == 0 { -9.0 } else { 9.0 }
            } else {
                0.0
            };
            let curve = Curve::between(from, to, shift);
            let class = if from.robot == to.robot { "edge memory" } else { "edge dds" };
            svg.path(class, &curve.path());
            svg.path(
                if from.robot == to.robot { "head memory" } else { "head dds" },
                &curve.head(),
            );
            // A number stands where it hides no other.
            let free = |at: &(f64, f64)| {
                let far =
                    |other: &((f64, f64), usize)| (other.0.0 - at.0).hypot(other.0.1 - at.1) > 19.0;
                badges.iter().all(far)
            };
            let places = [0.5, 0.35, 0.65, 0.25, 0.75].map(|t| curve.at(t));
            badges.push((places.into_iter().find(free).unwrap_or(places[0]), edge.number));
        }
        for (at, number) in badges {
            svg.disc("badge", at, 9.0);
            svg.text("badge-text", (at.0, at.1 + 4.0), Anchor::Middle, &number.to_string());
        }
    }
}

fn left_of(column: usize) -> f64 {
    let gap = (WIDTH - 2.0 * MARGIN - 3.0 * BOX_WIDTH) / 2.0;
    (0..column).fold(MARGIN, |left, _| left + BOX_WIDTH + gap)
}

fn row_height(boxes: &[GraphBox]) -> f64 {
    let parts = boxes.iter().map(|robot| robot.parts.len()).max().unwrap_or(0).max(1);
    (0..parts).fold(HEAD + 18.0, |height, _| height + PART_STEP) - 10.0
}

impl GraphBox {
    /// Draws the robot and says where the middles of its components are.
    fn draw(&self, svg: &mut Svg, at: (f64, f64), height: f64) -> Vec<(String, (f64, f64))> {
        svg.rect("robot", at, (BOX_WIDTH, height), "");
        svg.text("title", (at.0 + 10.0, at.1 + 20.0), Anchor::Start, &self.name);
        svg.text("tick", (at.0 + BOX_WIDTH - 8.0, at.1 + 20.0), Anchor::End, &self.note);
        let mut top = at.1 + HEAD;
        let mut spots = Vec::new();
        for (name, moved) in &self.parts {
            let corner = (at.0 + 34.0, top);
            let size = (BOX_WIDTH - 68.0, PART_HEIGHT);
            svg.rect(if *moved { "part moved" } else { "part" }, corner, size, "");
            let middle = (corner.0 + size.0 / 2.0, top + PART_HEIGHT / 2.0);
            svg.text("part-text", (middle.0, middle.1 + 4.0), Anchor::Middle, name);
            spots.push((name.clone(), middle));
            top += PART_STEP;
        }
        if self.parts.is_empty() {
            let middle = (at.0 + BOX_WIDTH / 2.0, at.1 + HEAD + 24.0);
            svg.text("tick", middle, Anchor::Middle, "no component");
        }
        spots
    }
}

/// A cubic curve from one component to another.
struct Curve {
    points: [(f64, f64); 4],
}

impl Curve {
    fn between(from: &Spot, to: &Spot, shift: f64) -> Self {
        let half = (BOX_WIDTH - 68.0) / 2.0;
        let ((x1, y1), (x2, y2)) = (from.middle, to.middle);
        if from.robot == to.robot {
            return Self::inside(from, to, shift);
        }
        if from.column == to.column {
            // Robots of two rows: out and in on the right.
            let (start, end) = ((x1 + half, y1 + shift), (x2 + half, y2 + shift));
            let out = 60.0;
            return Self { points: [start, (start.0 + out, y1), (end.0 + out, y2), end] };
        }
        let side = if x2 > x1 { 1.0 } else { -1.0 };
        let start = (x1 + side * half, y1 + shift);
        let end = (x2 - side * half, y2 + shift);
        let bend = (end.0 - start.0) * 0.45;
        // Beyond a neighbour it goes below what stands between.
        let sag = if from.column.abs_diff(to.column) > 1 { 2.2 * PART_STEP } else { 0.0 };
        let out = (start.0 + bend, start.1 + sag);
        Self { points: [start, out, (end.0 - bend, end.1 + sag), end] }
    }

    /// Between two components of one robot: straight when neighbours, else round the side.
    fn inside(from: &Spot, to: &Spot, shift: f64) -> Self {
        let ((x1, y1), (x2, y2)) = (from.middle, to.middle);
        let down = if y2 >= y1 { 1.0 } else { -1.0 };
        if (y2 - y1).abs() <= PART_STEP + 1.0 {
            let start = (x1 + shift, y1 + down * PART_HEIGHT / 2.0);
            let end = (x2 + shift, y2 - down * PART_HEIGHT / 2.0);
            let third = (end.1 - start.1) / 3.0;
            return Self {
                points: [start, (start.0, start.1 + third), (end.0, end.1 - third), end],
            };
        }
        let half = (BOX_WIDTH - 68.0) / 2.0;
        let (start, end) = ((x1 - half, y1 + shift), (x2 - half, y2 + shift));
        Self { points: [start, (start.0 - 30.0, start.1), (end.0 - 30.0, end.1), end] }
    }

    fn path(&self) -> String {
        let [a, b, c, d] = self.points;
        format!(
            "M{:.1} {:.1} C{:.1} {:.1} {:.1} {:.1} {:.1} {:.1}",
            a.0, a.1, b.0, b.1, c.0, c.1, d.0, d.1
        )
    }

    /// The tip of the arrow, in the direction in which the curve ends.
    fn head(&self) -> String {
        let [_, _, before, end] = self.points;
        let (dx, dy) = (end.0 - before.0, end.1 - before.1);
        let length = dx.hypot(dy).max(1e-6);
        let (ux, uy) = (dx / length, dy / length);
        let back = (end.0 - 9.0 * ux, end.1 - 9.0 * uy);
        format!(
            "M{:.1} {:.1} L{:.1} {:.1} L{:.1} {:.1} Z",
            end.0,
            end.1,
            back.0 - 4.5 * uy,
            back.1 + 4.5 * ux,
            back.0 + 4.5 * uy,
            back.1 - 4.5 * ux
        )
    }

    fn at(&self, t: f64) -> (f64, f64) {
        let u = 1.0 - t;
        let weights = [u * u * u, 3.0 * u * u * t, 3.0 * u * t * t, t * t * t];
        let parts = weights.iter().zip(&self.points);
        parts.fold((0.0, 0.0), |sum, (weight, point)| {
            (sum.0 + weight * point.0, sum.1 + weight * point.1)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_memory_and_dds_are_told_apart_and_a_lost_end_draws_no_arrow() {
        let robot = |name: &str, parts: &[&str]| GraphBox {
            name: name.to_owned(),
            note: String::new(),
            parts: parts.iter().map(|part| ((*part).to_owned(), false)).collect(),
        };
        let edge = |from: &str, to: &str, number| GraphEdge {
            from: from.to_owned(),
            to: to.to_owned(),
            number,
        };
        let graph = Graph {
            boxes: vec![
                robot("robot-1", &["fisheye", "anomaly"]),
                robot("robot-2", &["controller"]),
            ],
            edges: vec![
                edge("fisheye", "anomaly", 1),
                edge("anomaly", "controller", 2),
                edge("nobody", "controller", 3),
            ],
        };

        let text = graph.draw("before");

        assert_eq!(text.matches("class=\"edge memory\"").count(), 1, "{text}");
        assert_eq!(text.matches("class=\"edge dds\"").count(), 1, "{text}");
        assert_eq!(text.matches("class=\"badge\"").count(), 2, "{text}");
    }
}
