//! An implicit surface of the hand: a function that is negative inside, in metres, close to a distance near zero.
//!
//! Rounded cones, triangles and spheres are united smoothly (the polynomial blend of Inigo Quilez' articles on
//! distance functions); neighbouring fingers are not blended with each other, only with the palm.

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{DigitAngles, HandPose, kinematics, rig::Rig},
};

use super::anatomy;

/// One shape of the hand.
#[derive(Clone, Copy, Debug)]
enum Shape {
    /// The hull of two spheres.
    Cone {
        start: Vec3,
        end: Vec3,
        start_radius: f32,
        end_radius: f32,
    },
    /// All points closer than `radius` to a triangle.
    Sheet { corners: [Vec3; 3], radius: f32 },
}

impl Shape {
    fn cone(start: Vec3, end: Vec3, start_radius: f32, end_radius: f32) -> Self {
        Self::Cone {
            start,
            end,
            start_radius,
            end_radius,
        }
    }

    fn value(&self, p: Vec3) -> f32 {
        match *self {
            Self::Cone {
                start,
                end,
                start_radius,
                end_radius,
            } => {
                // Not the exact distance to the hull, but the radius changes slowly enough along all cones used here.
                let axis = end - start;
                let t = ((p - start).dot(axis) / axis.length_squared().max(1e-12)).clamp(0.0, 1.0);
                p.distance(start + t * axis) - (start_radius + t * (end_radius - start_radius))
            }
            Self::Sheet { corners, radius } => distance_to_triangle(p, corners) - radius,
        }
    }
}

/// Distance from a point to a triangle.
fn distance_to_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let normal = (b - a).cross(c - a).normalize_or(Vec3::Z);
    let inside = |u: Vec3, v: Vec3| normal.cross(v - u).dot(p - u) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        return (p - a).dot(normal).abs();
    }
    let to_edge = |u: Vec3, v: Vec3| {
        let t = ((p - u).dot(v - u) / (v - u).length_squared().max(1e-12)).clamp(0.0, 1.0);
        p.distance(u + t * (v - u))
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

/// The smooth minimum: the smaller of both, up to a quarter of `width` less where they differ by less than `width`.
fn smooth_min(a: f32, b: f32, width: f32) -> f32 {
    let overlap = (width - (a - b).abs()).max(0.0) / width;
    a.min(b) - 0.25 * width * overlap * overlap
}

/// Shapes that are blended with each other over a width.
#[derive(Clone, Debug)]
struct Blend {
    shapes: Vec<Shape>,
    width: f32,
}

impl Blend {
    fn value(&self, p: Vec3) -> f32 {
        self.shapes
            .iter()
            .map(|shape| shape.value(p))
            .reduce(|a, b| smooth_min(a, b, self.width))
            .unwrap_or(f32::INFINITY)
    }
}

/// The surface of a posed hand in the wrist frame.
#[derive(Clone, Debug)]
pub(super) struct HandField {
    palm: Blend,
    webs: Blend,
    digits: [Blend; 5],
    /// Over what width a digit flows into the palm.
    root_width: [f32; 5],
    /// Where the forearm is cut off along y.
    cut: f32,
    metre_per_mm: f32,
}

impl HandField {
    /// The surface of a right-handed `rig` with digits at `angles`.
    pub(super) fn new(rig: &Rig, angles: &[DigitAngles; 5], metres_per_mm: f32) -> Self {
        let mm = metres_per_mm;
        let frames = kinematics::hand_frames(
            rig,
            &HandPose {
                frame_from_wrist: Pose::IDENTITY,
                digits: *angles,
            },
        );
        let digits = std::array::from_fn(|digit| Blend {
            shapes: digit_shapes(digit, &frames.digits[digit], rig, mm),
            width: 4.0 * mm,
        });
        Self {
            palm: Blend {
                shapes: palm_shapes(rig, &frames, mm),
                width: 13.0 * mm,
            },
            webs: Blend {
                shapes: web_shapes(rig, &frames, mm),
                width: 2.0 * mm,
            },
            digits,
            root_width: [12.0, 7.0, 7.0, 7.0, 7.0].map(|w| w * mm),
            cut: -40.0 * mm,
            metre_per_mm: mm,
        }
    }

    /// Negative inside, positive outside, in metres.
    pub(super) fn value(&self, p: Vec3) -> f32 {
        let mm = self.metre_per_mm;
        let palm = smooth_min(self.palm.value(p), self.webs.value(p), 6.0 * mm);
        let whole = self
            .digits
            .iter()
            .zip(self.root_width)
            .map(|(digit, width)| smooth_min(digit.value(p), palm, width))
            .fold(palm, f32::min);
        // The forearm ends in a plane with a rounded edge.
        -smooth_min(-whole, -(self.cut - p.y), 14.0 * mm)
    }

    /// The direction in which the value grows, a unit vector.
    pub(super) fn normal(&self, p: Vec3) -> Vec3 {
        // A tenth of a millimetre: far above rounding, far below every radius.
        let step = 1e-4;
        let along = |axis: Vec3| self.value(p + step * axis) - self.value(p - step * axis);
        Vec3::new(along(Vec3::X), along(Vec3::Y), along(Vec3::Z)).normalize_or(Vec3::Z)
    }

    /// The nearest point of the surface, for points near it.
    pub(super) fn project(&self, mut p: Vec3) -> Vec3 {
        for _ in 0..4 {
            let value = self.value(p);
            if value.abs() < 1e-6 {
                break;
            }
            p -= value * self.normal(p);
        }
        p
    }

    /// Distance from an inner point to the surface in a direction, in metres.
    pub(super) fn distance_to_skin(&self, from: Vec3, direction: Vec3) -> f32 {
        let mut t = 0.0;
        for _ in 0..64 {
            // Blending makes the value smaller than the distance outside and larger inside: half steps are safe.
            let step = -0.5 * self.value(from + t * direction);
            t += step;
            if step.abs() < 1e-6 {
                break;
            }
        }
        t
    }
}

/// The phalanges of a digit; the thumb's metacarpal belongs to the palm.
fn digit_shapes(digit: usize, frames: &kinematics::DigitFrames, rig: &Rig, mm: f32) -> Vec<Shape> {
    let joint = anatomy::joint_diameters_mm(digit).map(|d| 0.5 * d * mm);
    let link = rig.digits[digit].diameters.map(|d| 0.5 * d);
    let lengths = rig.digits[digit].lengths;
    let at = |j: usize, y: f32, z: f32| frames.links[j].transform_point(Vec3::new(0.0, y, z));
    let mut shapes = Vec::new();
    let first = usize::from(digit == 0);
    for j in first..2 {
        // A phalanx is slimmer in the middle than at its joints; the front is fuller than the back.
        let (near, far) = (if j == 0 { link[0] } else { joint[j] }, joint[j + 1]);
        let waist = link[j] - 0.5 * mm;
        let half = 0.5 * lengths[j];
        shapes.push(Shape::cone(
            at(j, 0.0, 0.0),
            at(j, half, 0.3 * mm),
            near - 0.6 * mm,
            waist,
        ));
        shapes.push(Shape::cone(
            at(j, half, 0.3 * mm),
            at(j, lengths[j], 0.0),
            waist,
            far - 0.6 * mm,
        ));
    }
    // The last phalanx: from its joint to a smaller round tip, with the pulp in front of the bone.
    let tip = 0.78 * link[2];
    let pulp = 0.86 * link[2];
    let end = lengths[2] - tip;
    shapes.push(Shape::cone(
        at(2, 0.0, 0.0),
        at(2, 0.55 * lengths[2], link[2] - pulp - 0.2 * mm),
        joint[2] - 0.6 * mm,
        pulp,
    ));
    shapes.push(Shape::cone(
        at(2, 0.55 * lengths[2], link[2] - pulp - 0.2 * mm),
        at(2, end, 0.6 * (link[2] - tip)),
        pulp,
        tip,
    ));
    shapes
}

/// The palm with the balls of thumb and little finger, the webs and the wrist.
fn palm_shapes(rig: &Rig, frames: &kinematics::HandFrames, mm: f32) -> Vec<Shape> {
    let point = |x: f32, y: f32, z: f32| mm * Vec3::new(x, y, z);
    let mut shapes = Vec::new();
    // The four metacarpals with their flesh, a little in front of the bones.
    let near = [12.0, 12.5, 12.5, 11.5];
    let far = [11.4, 11.6, 11.0, 10.2];
    for finger in 0..4 {
        let start = rig.finger_metacarpals[finger] + point(0.0, 0.0, 1.0);
        let knuckle = frames.digits[finger + 1].links[0].position;
        shapes.push(Shape::cone(
            start,
            knuckle + point(0.0, -4.0, 1.5),
            near[finger] * mm,
            far[finger] * mm,
        ));
    }
    // The ball of the thumb: around its metacarpal, and a broad root in the palm.
    let thumb = frames.digits[0].links;
    let (cmc, mcp) = (thumb[0].position, thumb[1].position);
    let bulk = thumb[0].transform_point(point(0.0, 22.0, 4.0));
    shapes.push(Shape::cone(
        cmc + point(-2.0, 0.0, 1.0),
        bulk,
        12.0 * mm,
        13.5 * mm,
    ));
    shapes.push(Shape::cone(bulk, mcp, 13.5 * mm, 11.0 * mm));
    shapes.push(Shape::cone(
        point(10.0, 24.0, 7.0),
        bulk + point(-9.0, 2.0, 1.0),
        12.0 * mm,
        12.0 * mm,
    ));
    // The ball of the little finger.
    shapes.push(Shape::cone(
        point(-21.0, 16.0, 4.0),
        point(-31.0, 52.0, 4.5),
        11.5 * mm,
        11.5 * mm,
    ));
    // Carpus, wrist and forearm: an oval, narrowest just behind the wrist's crease.
    for side in [-1.0, 1.0] {
        shapes.push(Shape::cone(
            point(side * 11.0, -6.0, -0.5),
            point(side * 11.0, 28.0, 0.5),
            14.5 * mm,
            13.0 * mm,
        ));
        shapes.push(Shape::cone(
            point(side * 11.0, -6.0, -0.5),
            point(side * 11.5, -60.0, -1.0),
            14.5 * mm,
            17.5 * mm,
        ));
    }
    shapes
}

/// The webs between the digits, thin folds in front of the bones.
fn web_shapes(rig: &Rig, frames: &kinematics::HandFrames, mm: f32) -> Vec<Shape> {
    let mut shapes = Vec::new();
    // Between neighbouring fingers: up to a quarter of the first phalanx.
    let radius = 7.0 * mm;
    for finger in 1..4 {
        let [a, b] = [finger, finger + 1].map(|digit| frames.digits[digit].links[0]);
        let end = |frame: Pose, digit: usize| {
            frame.transform_point(Vec3::new(0.0, 0.25 * rig.digits[digit].lengths[0], 2.5 * mm))
        };
        let (c, d) = (end(a, finger), end(b, finger + 1));
        // Lower than the knuckles' backs, which stand out between them.
        let [a, b] = [a, b].map(|frame| frame.transform_point(mm * Vec3::new(0.0, 0.0, 2.5)));
        shapes.push(Shape::Sheet {
            corners: [a, b, c],
            radius,
        });
        shapes.push(Shape::Sheet {
            corners: [b, d, c],
            radius,
        });
    }
    // Between thumb and index finger: from the CMC to the thumb's MCP and to the last quarter of the metacarpal.
    let thumb = frames.digits[0].links[0];
    let index_knuckle = frames.digits[1].links[0].position;
    shapes.push(Shape::Sheet {
        corners: [
            thumb.position,
            thumb.transform_point(mm * Vec3::new(0.0, 38.0, 2.0)),
            rig.finger_metacarpals[0].lerp(index_knuckle, 0.76),
        ],
        radius: 5.5 * mm,
    });
    shapes
}
