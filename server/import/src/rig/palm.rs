//! Fits the flesh of the palm, which hands carry as solids on their bones, to the skin.
//!
//! The solids start as those of the built-in hands at the same size. Each end then moves out of the palm or back, and grows or
//! shrinks, until the skin lies on the solids' union as well as that can be.

use glam::Vec3;
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{
        HandPose, Handedness,
        joints::{HandJoints, JOINT_COUNT, Joint, index, openxr_from_thesis_frame},
        kinematics::{fitted, hand_frames},
        rig::{EndChange, FLESH_SOLIDS, PalmFlesh, Rig},
    },
    physical::solids::{HandSolids, TaperedCapsule},
};

use super::{binding::bound_frames, radii::SkinVertex};

/// Fewest vertices for a fit.
const FEWEST: usize = 60;

/// Most vertices that are compared.
const MAX_VERTICES: usize = 600;

/// Distance in metres, at an adult's size, within which nine in ten palmar vertices of the built-in hands are.
const AS_FITTED: f32 = 0.0018;

/// Distances in metres beyond which a vertex counts no more than at it: wrinkles, strays, and what follows the wrist elsewhere.
const FARTHEST: f32 = 0.012;

/// How much a vertex of the back counts relative to one of the palmar side, where grasps touch.
const BACK: f32 = 0.2;

/// Cost of a change relative to a distance: of one that brings nothing, with few vertices nearby.
const INERTIA: f32 = 0.02;

/// Steps of changes in metres, at an adult's size.
const STEPS: [f32; 5] = [0.004, 0.002, 0.001, 0.0005, 0.00025];

/// Rounds over all ends at each step.
const ROUNDS: usize = 4;

/// Least radius of a solid, in metres at an adult's size.
const MIN_RADIUS: f32 = 0.002;

/// The flesh of a right hand's palm; `None` if too few vertices show it. `joints` are those where the skin is bound.
pub(super) fn flesh(
    rig: &Rig,
    size: f32,
    joints: &[Vec3; JOINT_COUNT],
    skin: &[SkinVertex],
) -> Option<Box<PalmFlesh>> {
    let bound = bound_frames(rig, joints);
    let at_rest = HandJoints {
        handedness: Handedness::Right,
        joints: joints.map(|position| Joint {
            pose: openxr_from_thesis_frame(Pose::from_position(position)),
            radius: 1.0,
        }),
    };
    let pose = fitted(rig, &at_rest);
    // The ball of the thumb is where the posed rig has it.
    let posed_from_bound = hand_frames(rig, &pose).digits[0].links[0] * bound.digits[0].links[0].inverse();
    let is_of_palm = |joint: usize| joint == index::WRIST || index::FIRST_OF_DIGIT[1..].contains(&joint);
    let vertices = skin.iter().filter_map(|vertex| {
        if is_of_palm(vertex.joint) {
            // Skin behind the wrist is forearm.
            Some(vertex.position).filter(|position| position.y > 0.0)
        } else {
            let is_of_thumb = vertex.joint == index::FIRST_OF_DIGIT[0];
            is_of_thumb.then(|| posed_from_bound.transform_point(vertex.position))
        }
    });
    let vertices: Vec<Vec3> = vertices.collect();
    if vertices.len() < FEWEST {
        return None;
    }
    let every = vertices.len().div_ceil(MAX_VERTICES);
    let vertices: Vec<Vec3> = vertices.into_iter().step_by(every).collect();
    let fit = Fit::new(rig, size, pose, &vertices);
    (fit.distance_of_most() > AS_FITTED * size).then(|| Box::new(fit.best()))
}

/// Flesh that is being fitted.
struct Fit<'a> {
    rig: Rig,
    pose: HandPose,
    size: f32,
    vertices: &'a [Vec3],
    weights: Vec<f32>,
    /// The distance of each vertex from the links, which are not changed.
    from_links: Vec<f32>,
    /// The distance of each vertex from each solid.
    distances: [Vec<f32>; FLESH_SOLIDS],
}

impl<'a> Fit<'a> {
    fn new(rig: &Rig, size: f32, pose: HandPose, vertices: &'a [Vec3]) -> Self {
        let solids = HandSolids::of_pose(rig, &pose);
        let middle = rig.palm.z - rig.joint_radii[index::PALM];
        let weights = vertices
            .iter()
            .map(|vertex| if vertex.z > middle { 1.0 } else { BACK });
        let links = solids.phalanges.as_flattened();
        let from_links = vertices.iter().map(|&vertex| {
            let distances = links.iter().map(|link| link.signed_distance(vertex));
            distances.fold(f32::INFINITY, f32::min)
        });
        let own: Vec<&TaperedCapsule> = solids.palm.iter().chain(&solids.thenar).collect();
        Self {
            weights: weights.collect(),
            from_links: from_links.collect(),
            distances: std::array::from_fn(|solid| distances(own[solid], vertices)),
            rig: Rig {
                palm_flesh: Some(Box::default()),
                ..rig.clone()
            },
            pose,
            size,
            vertices,
        }
    }

    /// The distance from the solids that nine in ten of the palmar vertices do not exceed.
    fn distance_of_most(&self) -> f32 {
        let palmar = (0..self.vertices.len()).filter(|&vertex| self.weights[vertex] > BACK);
        let distances = palmar.map(|vertex| {
            let own = self.distances.iter().map(|solid| solid[vertex]);
            own.fold(self.from_links[vertex], f32::min).abs()
        });
        let mut distances: Vec<f32> = distances.collect();
        distances.sort_by(f32::total_cmp);
        distances.get(distances.len() * 9 / 10).copied().unwrap_or(0.0)
    }

    /// By turns along each parameter, in ever smaller steps.
    fn best(mut self) -> PalmFlesh {
        let mut flesh = PalmFlesh::default();
        for step in STEPS.map(|step| step * self.size) {
            for _ in 0..ROUNDS {
                let before = flesh.clone();
                for solid in 0..FLESH_SOLIDS {
                    self.improve(&mut flesh, solid, step);
                }
                if flesh == before {
                    break;
                }
            }
        }
        flesh
    }

    /// Changes the ends of one solid by a step wherever that brings the skin nearer.
    fn improve(&mut self, flesh: &mut PalmFlesh, solid: usize, step: f32) {
        let others = (0..self.vertices.len()).map(|vertex| {
            let others = (0..FLESH_SOLIDS).filter(|&other| other != solid);
            let others = others.map(|other| self.distances[other][vertex]);
            others.fold(self.from_links[vertex], f32::min)
        });
        let others: Vec<f32> = others.collect();
        let mut least = self.error(flesh, &others, &self.distances[solid]);
        for end in 0..2 {
            for change in [(step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)] {
                let mut tried = flesh.clone();
                let EndChange { offset, radius } = &mut tried.0[solid][end];
                *offset += change.0;
                *radius += change.1;
                let Some(distances) = self.distances_of(&tried, solid) else {
                    continue;
                };
                let error = self.error(&tried, &others, &distances);
                if error < least {
                    least = error;
                    *flesh = tried;
                    self.distances[solid] = distances;
                }
            }
        }
    }

    /// The distances of the vertices from a solid; `None` if it would be too thin.
    fn distances_of(&mut self, flesh: &PalmFlesh, solid: usize) -> Option<Vec<f32>> {
        self.rig.palm_flesh = Some(Box::new(flesh.clone()));
        let HandSolids { palm, thenar, .. } = HandSolids::of_pose(&self.rig, &self.pose);
        let changed = palm.iter().chain(&thenar).nth(solid)?;
        let is_thick = changed.start_radius.min(changed.end_radius) >= MIN_RADIUS * self.size;
        is_thick.then(|| distances(changed, self.vertices))
    }

    fn error(&self, flesh: &PalmFlesh, others: &[f32], own: &[f32]) -> f32 {
        let farthest = FARTHEST * self.size;
        let of_vertices = others.iter().zip(own).zip(&self.weights);
        let of_vertices = of_vertices
            .map(|((other, own), weight)| weight * other.min(*own).abs().min(farthest).powi(2))
            .sum::<f32>();
        let changes = flesh.0.iter().flatten();
        let inertia = changes
            .map(|end| end.offset.powi(2) + end.radius.powi(2))
            .sum::<f32>();
        of_vertices / self.vertices.len() as f32 + INERTIA * inertia / (2 * FLESH_SOLIDS) as f32
    }
}

fn distances(solid: &TaperedCapsule, vertices: &[Vec3]) -> Vec<f32> {
    let distances = vertices.iter().map(|&vertex| solid.signed_distance(vertex));
    distances.collect()
}

#[cfg(test)]
mod tests {
    use grasp_assets::hands::hand;

    use super::*;

    /// The distances of a skin from a rig's hand, ascending.
    fn distances_from(rig: &Rig, pose: &HandPose, skin: &[SkinVertex]) -> Vec<f32> {
        let solids = HandSolids::of_pose(rig, pose);
        let from = |vertex: &SkinVertex| {
            let distances = solids.iter().map(|solid| solid.signed_distance(vertex.position));
            distances.fold(f32::INFINITY, f32::min).abs()
        };
        let mut distances: Vec<f32> = skin.iter().map(from).collect();
        distances.sort_by(f32::total_cmp);
        distances
    }

    #[test]
    fn a_palm_is_as_thick_as_its_skin() {
        let adult: &Rig = &hand("adult", Handedness::Right).expect("it is built in").rig;
        let pose = HandPose {
            frame_from_wrist: Pose::IDENTITY,
            digits: adult.stretched(),
        };
        let joints = HandJoints::of_pose(adult, &pose)
            .joints
            .map(|joint| joint.pose.position);
        for change in [0.004, -0.004] {
            // A skin by formula: that of palms whose solids are out of the palm or behind it.
            let mut other = adult.clone();
            let flesh = other.palm_flesh.insert(Box::default());
            flesh
                .0
                .as_flattened_mut()
                .iter_mut()
                .for_each(|end| end.offset = change);
            let solids = HandSolids::of_pose(&other, &pose);
            let own: Vec<&TaperedCapsule> = solids.palm.iter().chain(&solids.thenar).collect();
            let mut skin = Vec::new();
            for (place, solid) in own.iter().enumerate() {
                let axis = (solid.end - solid.start).normalize_or(Vec3::Y);
                let across = axis.any_orthonormal_vector();
                for ring in 0..12 {
                    for turn in 0..24 {
                        let angle = std::f32::consts::TAU * turn as f32 / 24.0;
                        let along = ring as f32 / 11.0;
                        let ray = glam::Quat::from_axis_angle(axis, angle) * across;
                        let position = solid.at(along) + solid.radius_at(along) * ray;
                        let covers = |other: &TaperedCapsule| other.signed_distance(position) < -1e-4;
                        let is_covered = solids.iter().any(|other| other != *solid && covers(other));
                        if !is_covered && position.y > 0.0 {
                            let joint = if place < 10 {
                                index::WRIST
                            } else {
                                index::FIRST_OF_DIGIT[0]
                            };
                            skin.push(SkinVertex { joint, position });
                        }
                    }
                }
            }
            let before = distances_from(adult, &pose, &skin);
            let fitted = Rig {
                palm_flesh: super::flesh(adult, 1.0, &joints, &skin),
                ..adult.clone()
            };
            let after = distances_from(&fitted, &pose, &skin);
            let at = |distances: &[f32], share: f32| distances[(share * distances.len() as f32) as usize];
            assert!(at(&before, 0.5) > 0.0015, "{}", at(&before, 0.5));
            assert!(at(&after, 0.5) < 0.0006, "{change}: {}", at(&after, 0.5));
            assert!(at(&after, 0.9) < 0.002, "{change}: {}", at(&after, 0.9));
        }
    }
}
