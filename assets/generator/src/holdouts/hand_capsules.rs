//! The giver's hand as solids: one capsule per phalanx (Eq. 4.1 with round ends) and metacarpal, and points on the palm's
//! skin. Poses are made and measured with them.

use glam::Vec3;
use grasp_assets::hands::Hand;
use grasp_synthesis::{
    base::pose::Pose,
    geometry::mesh_bvh::MeshBvh,
    model::hand::{
        HandPose,
        joints::{HandJoints, index},
        kinematics::hand_frames,
    },
};

/// Samples along a capsule's axis at which its distance to the object is measured: every 5 mm on the longest phalanx.
pub(crate) const AXIS_SAMPLES: usize = 7;

/// Distance between the points kept on the palm's skin, in metres: half the thinnest handle that is held.
const PALM_SPACING: f32 = 0.004;

/// Everything within `radius` metres of a segment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capsule {
    /// One end of the axis.
    pub(crate) start: Vec3,
    /// The other end.
    pub(crate) end: Vec3,
    /// In metres.
    pub(crate) radius: f32,
}

impl Capsule {
    /// A point of the axis: 0 is the start, 1 the end.
    pub(crate) fn at(&self, share: f32) -> Vec3 {
        self.start.lerp(self.end, share)
    }

    /// The points at which the distance to the object is measured.
    pub(crate) fn axis_samples(&self) -> [Vec3; AXIS_SAMPLES] {
        std::array::from_fn(|i| self.at(i as f32 / (AXIS_SAMPLES - 1) as f32))
    }

    /// Distance from a point to the capsule's surface, negative inside.
    pub(crate) fn distance(&self, point: Vec3) -> f32 {
        let axis = self.end - self.start;
        let share = (point - self.start).dot(axis) / axis.length_squared().max(1e-12);
        self.at(share.clamp(0.0, 1.0)).distance(point) - self.radius
    }

    /// Distance between the axes of two capsules (Ericson, Real-Time Collision Detection, 5.1.9).
    pub(crate) fn axis_distance(&self, other: &Self) -> f32 {
        let d1 = self.end - self.start;
        let d2 = other.end - other.start;
        let r = self.start - other.start;
        let (a, e, f) = (
            d1.length_squared().max(1e-12),
            d2.length_squared().max(1e-12),
            d2.dot(r),
        );
        let (b, c) = (d1.dot(d2), d1.dot(r));
        let determinant = a * e - b * b;
        let mut s = if determinant > 1e-12 {
            ((b * f - c * e) / determinant).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let mut t = (b * s + f) / e;
        if t < 0.0 {
            t = 0.0;
            s = (-c / a).clamp(0.0, 1.0);
        } else if t > 1.0 {
            t = 1.0;
            s = ((b - c) / a).clamp(0.0, 1.0);
        }
        self.at(s).distance(other.at(t))
    }
}

/// The parts of the hand that do not depend on joint angles, in the wrist frame.
#[derive(Clone, Debug)]
pub(crate) struct Palm {
    /// Points on its skin, except the thumb's.
    pub(crate) points: Vec<Vec3>,
    /// The metacarpals of the four fingers.
    pub(crate) metacarpals: [Capsule; 4],
}

impl Palm {
    /// The palm of a hand.
    pub(crate) fn of(hand: &Hand) -> Self {
        let stretched = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: hand.rig.stretched(),
        };
        let joints = HandJoints::of_pose(&hand.rig, &stretched);
        let skin = hand.skin.posed(&joints);
        let moves_with_digits = |vertex: usize| {
            hand.skin.joint_indices[vertex]
                .iter()
                .zip(hand.skin.weights[vertex])
                .filter(|&(&joint, _)| {
                    let joint = usize::from(joint);
                    let thumb = (index::FIRST_OF_DIGIT[0]..=index::TIP_OF_DIGIT[0]).contains(&joint);
                    thumb
                        || (1..5)
                            .any(|d| (index::FIRST_OF_DIGIT[d] + 1..=index::TIP_OF_DIGIT[d]).contains(&joint))
                })
                .map(|(_, weight)| weight)
                .sum::<f32>()
                > 0.3
        };
        let mut points: Vec<Vec3> = Vec::new();
        for (vertex, &point) in skin.iter().enumerate() {
            let taken = |p: &Vec3| p.distance_squared(point) < PALM_SPACING * PALM_SPACING;
            if !moves_with_digits(vertex) && !points.iter().any(taken) {
                points.push(point);
            }
        }
        let metacarpals = std::array::from_fn(|finger| Capsule {
            start: hand.rig.finger_metacarpals[finger],
            end: hand.rig.digits[finger + 1].wrist_from_base.position,
            radius: hand.rig.joint_radii[index::FIRST_OF_DIGIT[finger + 1]]
                .min(hand.rig.joint_radii[index::FIRST_OF_DIGIT[finger + 1] + 1]),
        });
        Self { points, metacarpals }
    }
}

/// The links of a posed hand, thumb first.
pub(crate) fn links(hand: &Hand, pose: &HandPose) -> [[Capsule; 3]; 5] {
    let frames = hand_frames(&hand.rig, pose);
    std::array::from_fn(|digit| {
        let chain = &frames.digits[digit];
        let ends = [chain.links[1].position, chain.links[2].position, chain.tip];
        std::array::from_fn(|link| {
            let radius = 0.5 * hand.rig.digits[digit].diameters[link];
            let start = chain.links[link].position;
            // The round end of the last link ends at the fingertip instead of beyond it.
            let end = if link == 2 {
                let direction = (ends[link] - start).normalize_or(Vec3::Y);
                ends[link] - direction * radius
            } else {
                ends[link]
            };
            Capsule { start, end, radius }
        })
    })
}

/// Distance from a point to a closed surface, negative inside; `reach` if it is farther outside than that.
pub(crate) fn signed_distance(surface: &MeshBvh, point: Vec3, reach: f32) -> f32 {
    match surface.closest_point_within(point, reach) {
        Some(closest) if surface.contains(point) => -closest.distance,
        Some(closest) => closest.distance,
        None if surface.contains(point) => -reach,
        None => reach,
    }
}

#[cfg(test)]
mod tests {
    use super::Capsule;
    use glam::Vec3;

    #[test]
    fn axis_distance_agrees_with_dense_sampling() {
        // Fixed, irregular pairs: crossing, parallel, end to end, degenerate.
        let points: Vec<Vec3> = (0_u16..24)
            .map(|i| {
                let i = f32::from(i);
                Vec3::new(
                    (i * 1.7).sin(),
                    (i * 2.3).cos(),
                    (i * 0.9).sin() * (i * 0.4).cos(),
                )
            })
            .collect();
        let capsule = |a: usize, b: usize| Capsule {
            start: points[a],
            end: points[b],
            radius: 0.1,
        };
        for i in 0..20 {
            let (a, b) = (capsule(i, i + 1), capsule(i + 2, i + 3));
            let mut brute = f32::INFINITY;
            for s in 0_u16..=400 {
                for t in 0_u16..=400 {
                    let distance = a.at(f32::from(s) / 400.0).distance(b.at(f32::from(t) / 400.0));
                    brute = brute.min(distance);
                }
            }
            let exact = a.axis_distance(&b);
            assert!(
                exact <= brute + 1e-5 && brute - exact < 0.01,
                "{i}: {exact} against {brute}"
            );
        }
    }
}
