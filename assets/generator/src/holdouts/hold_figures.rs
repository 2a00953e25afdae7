//! Measures a hold as a person would look at it: what touches, how deep, how much the hand covers.

use glam::Vec3;
use grasp_assets::hands::Hand;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::{Segment, mesh::TriangleMesh, mesh_bvh::MeshBvh},
    model::{
        hand::{HandPose, joints::HandJoints, kinematics::hand_frames},
        holdout::PresentingHand,
    },
};

use super::{
    halton::halton,
    hand_capsules::{Capsule, Palm, links, signed_distance},
};

/// A hand farther than this from a point of the surface does not cover it, in metres: about one and a half fingers, which
/// leaves room for a receiver's fingers.
const COVER_REACH: f32 = 0.03;

/// Links farther from the object than this count as this far, in metres.
const CLEARANCE_REACH: f32 = 0.04;

/// Length and radius of the forearm behind the wrist, which must be clear of the object, in metres.
const FOREARM: (f32, f32) = (0.25, 0.03);

/// A point of a surface with its outward normal.
pub(crate) type SurfacePoint = (Vec3, Vec3);

/// `count` points spread evenly over a mesh's area, the same ones every time.
pub(crate) fn surface_points(mesh: &TriangleMesh, count: u32) -> Vec<SurfacePoint> {
    let mut sums = Vec::with_capacity(mesh.triangles().len());
    let mut total = 0.0_f64;
    for triangle in 0..mesh.triangles().len() {
        let [a, b, c] = mesh.corners(triangle);
        total += f64::from((b - a).cross(c - a).length());
        sums.push(total);
    }
    (1..=count)
        .map(|i| {
            let at = halton(i, 2) * total;
            let triangle = sums.partition_point(|&sum| sum < at).min(sums.len() - 1);
            let (root, v) = (halton(i, 3).sqrt() as f32, halton(i, 5) as f32);
            let [a, b, c] = mesh.corners(triangle);
            let point = a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v);
            (point, mesh.normal(triangle))
        })
        .collect()
}

/// The surface points that the hand does not cover: no part of it is within 3 cm along the outward normal.
pub(crate) fn uncovered<'a>(points: &'a [SurfacePoint], hand: &MeshBvh) -> Vec<&'a SurfacePoint> {
    points
        .iter()
        .filter(|&&(point, normal)| {
            let ray = Segment::new(point, point + normal * COVER_REACH);
            !hand.is_crossed_by(ray) && !hand.contains(point)
        })
        .collect()
}

/// The share of the surface points that the hand covers.
pub(crate) fn coverage(points: &[SurfacePoint], hand: &MeshBvh) -> f32 {
    1.0 - uncovered(points, hand).len() as f32 / points.len() as f32
}

/// The hand's posed skin, if it can be posed.
pub(crate) fn posed_skin(hand: &Hand, pose: &HandPose) -> Option<MeshBvh> {
    let joints = HandJoints::of_pose(&hand.rig, pose);
    PresentingHand::new(&hand.skin, joints)
        .ok()
        .and_then(|presenting| presenting.skin)
}

/// How deep skin and object overlap, in metres: the deepest skin vertex in the object, and the deepest surface point
/// in the skin.
pub(crate) fn overlap(object: &MeshBvh, points: &[SurfacePoint], skin: &MeshBvh) -> (f32, f32) {
    let deepest = |surface: &MeshBvh, point: Vec3| (-signed_distance(surface, point, 0.03)).max(0.0);
    let vertex = skin
        .mesh()
        .positions()
        .iter()
        .map(|&v| deepest(object, v))
        .fold(0.0, f32::max);
    let sample = points.iter().map(|&(p, _)| deepest(skin, p)).fold(0.0, f32::max);
    (vertex, sample)
}

/// A link relative to the object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkFigures {
    /// Distance between its skin and the object in metres, negative where they overlap.
    pub(crate) clearance: f32,
    /// Where the object is closest, in the object's frame.
    pub(crate) closest: Vec3,
    /// From the link's axis to there: a unit vector in the object's frame.
    pub(crate) towards: Vec3,
    /// The same in the link's frame: +z is the pad, +x a right hand's thumb side.
    pub(crate) side: Vec3,
}

impl LinkFigures {
    fn of(object: &MeshBvh, link: &Capsule, frame: Pose) -> Self {
        let reach = CLEARANCE_REACH + link.radius;
        let mut figures = Self {
            clearance: CLEARANCE_REACH,
            closest: link.start,
            towards: Vec3::ZERO,
            side: Vec3::ZERO,
        };
        for point in link.axis_samples() {
            let Some(closest) = object.closest_point_within(point, reach) else {
                continue;
            };
            let inside = object.contains(point);
            let distance = if inside {
                -closest.distance
            } else {
                closest.distance
            };
            if distance - link.radius < figures.clearance {
                figures.clearance = distance - link.radius;
                figures.closest = closest.position;
                let towards = (closest.position - point).normalize_or_zero();
                figures.towards = if inside { -towards } else { towards };
                figures.side = frame.orientation.conjugate() * figures.towards;
            }
        }
        figures
    }
}

/// Measures of a hand on an object.
#[derive(Clone, Debug)]
pub(crate) struct Figures {
    /// Each link relative to the object; thumb first.
    pub(crate) links: [[LinkFigures; 3]; 5],
    /// Distance between the palm's skin and the object in metres, negative where they overlap.
    pub(crate) palm: f32,
    /// The deepest overlap of two digits, or of a digit and the palm's bones, in metres.
    pub(crate) self_overlap: f32,
    /// How deep the object reaches into the forearm, in metres.
    pub(crate) forearm_overlap: f32,
}

impl Figures {
    /// Measures a hand in the object's frame.
    pub(crate) fn of(
        hand: &Hand,
        palm: &Palm,
        object: &MeshBvh,
        points: &[SurfacePoint],
        pose: &HandPose,
    ) -> Self {
        let chains = links(hand, pose);
        let wrist = pose.frame_from_wrist;
        let frames = hand_frames(&hand.rig, pose);
        let links = std::array::from_fn(|d| {
            std::array::from_fn(|l| LinkFigures::of(object, &chains[d][l], frames.digits[d].links[l]))
        });
        let palm_clearance = palm
            .points
            .iter()
            .map(|&p| signed_distance(object, wrist.transform_point(p), CLEARANCE_REACH))
            .fold(CLEARANCE_REACH, f32::min);
        let mut self_overlap = 0.0_f32;
        for first in 0..5 {
            for second in first + 1..5 {
                for (i, a) in chains[first].iter().enumerate() {
                    for (j, b) in chains[second].iter().enumerate() {
                        // The roots of neighbouring digits share their flesh.
                        if i + j > 0 {
                            self_overlap = self_overlap.max(a.radius + b.radius - a.axis_distance(b));
                        }
                    }
                }
            }
        }
        let (length, radius) = FOREARM;
        let forearm = Capsule {
            start: wrist.transform_point(Vec3::Y * -(radius + 0.01)),
            end: wrist.transform_point(Vec3::Y * -length),
            radius,
        };
        let forearm_overlap = points
            .iter()
            .map(|&(p, _)| -forearm.distance(p))
            .fold(0.0, f32::max);
        Self {
            links,
            palm: palm_clearance,
            self_overlap,
            forearm_overlap,
        }
    }

    /// The deepest overlap of hand and object, in metres.
    pub(crate) fn depth(&self) -> f32 {
        let links = self.links.iter().flatten();
        -links
            .map(|link| link.clearance)
            .fold(self.palm, f32::min)
            .min(0.0)
    }
}
