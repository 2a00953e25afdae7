//! Checks hands: joint angles of a rig, tracked joints, and meshes.

mod anatomy;
mod posed;
#[cfg(test)]
mod tests;
mod tracked;

use std::{ops::RangeInclusive, sync::Arc};

use glam::Vec3;
use grasp_assets::hands::RIG_NAMES;
use grasp_proto::v1::{self, presenting_hand::Form};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::joints::{HandJoints, Skin},
};

use super::{FARTHEST, Field, holdout::Frames, pose, quoted};
use crate::{
    convention::Convention,
    rigs::{StoredRig, name_of, store::RigStore},
};
use posed::jointed_hand;
pub(super) use posed::{
    AngleBounds, Place, PosedHand, checked_digits, convention_of, posed_hand, wrist_at_object,
};
pub(super) use tracked::{AllowedGaps, tracked_hand};

/// Largest numbers of vertices and of triangles, of all hands of a request together: twice those of a hand in a game. Some queries
/// of the search may look at every triangle of a hostile mesh.
const MAX_MESH: usize = 6000;

/// Allowed sizes of a hand relative to its rig: from a toddler's to a giant's.
pub(super) const HAND_SCALES: RangeInclusive<f32> = 0.5..=2.0;

/// The giver's hand, in the client's frame and `OpenXR` axes.
#[derive(Clone, Debug)]
pub(crate) enum GiverHand {
    Jointed(Box<JointedHand>),
    Meshed(MeshedHand),
}

/// A hand whose joints are known, in the client's frame and `OpenXR` axes.
#[derive(Clone, Debug)]
pub(crate) struct JointedHand {
    pub joints: HandJoints,
    pub skin: Arc<Skin>,
    pub field: &'static str,
    pub warnings: Vec<String>,
}

/// A hand of which the surface is known, in the client's frame and `OpenXR` axes.
#[derive(Clone, Debug)]
pub(crate) struct MeshedHand {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    pub client_from_wrist: Option<Pose>,
    pub field: String,
}

impl GiverHand {
    pub(crate) fn warnings(&self) -> &[String] {
        match self {
            Self::Jointed(hand) => &hand.warnings,
            Self::Meshed(_) => &[],
        }
    }

    pub(crate) fn move_by(&mut self, by: Pose) {
        match self {
            Self::Jointed(hand) => hand.joints = hand.joints.transformed(by),
            Self::Meshed(hand) => {
                for position in &mut hand.positions {
                    *position = by.transform_point(*position);
                }
                if let Some(wrist) = &mut hand.client_from_wrist {
                    *wrist = by * *wrist;
                }
            }
        }
    }
}

/// The giver's hand or another one to keep clear of; `None` if it is wrong.
pub(super) fn presenting_hand(
    field: Field<'_>,
    hand: v1::PresentingHand,
    frames: &Frames<'_>,
) -> Option<GiverHand> {
    let convention = frames.convention;
    let jointed = match hand.form {
        None => return field.reject("is empty; it must have a pose, joints or a mesh, or be absent"),
        Some(Form::Mesh(mesh)) => {
            return meshed_hand(field.child("mesh"), &mesh, convention).map(GiverHand::Meshed);
        }
        Some(Form::Pose(pose)) => jointed_hand(field.child("pose"), &pose, frames),
        Some(Form::Joints(joints)) => {
            tracked_hand(field.child("joints"), &joints, convention, AllowedGaps::Nothing)
        }
    };
    jointed.map(|hand| GiverHand::Jointed(Box::new(hand)))
}

/// Further hands, at most this many, without wrong ones.
pub(super) fn presenting_hands(
    field: Field<'_>,
    sent: Vec<v1::PresentingHand>,
    most: usize,
    frames: &Frames<'_>,
) -> Vec<GiverHand> {
    let hands = field.each(sent.into_iter().take(most), |field, sent| {
        presenting_hand(field, sent, frames)
    });
    hands.flatten().collect()
}

pub(super) fn rig_named(field: Field<'_>, name: &str, rigs: &RigStore) -> Option<Arc<StoredRig>> {
    let rig = rigs.named(name);
    if rig.is_none() && rigs.is_damaged(name) {
        field.add_damaged_rig(name);
    } else if rig.is_none() {
        field.add(format_args!(
            "is {}; the built-in rigs are {}, and no such rig was created",
            quoted(name),
            RIG_NAMES.map(name_of).join(" and ")
        ));
    }
    rig
}

fn meshed_hand(field: Field<'_>, mesh: &v1::HandMesh, convention: Convention) -> Option<MeshedHand> {
    field.if_right(|| {
        let coordinates_field = field.child("client_coordinates");
        let coordinates = threes(coordinates_field, &mesh.client_coordinates);
        let triangles_field = field.child("triangles");
        let triangles = threes(triangles_field, &mesh.triangles);
        let farthest = convention.length_from_openxr(FARTHEST);
        let is_near = |position: &[f32; 3]| position.iter().all(|number| number.abs() <= farthest);
        if let Some((count, vertex, &position)) = wrong(coordinates, is_near) {
            let position = Vec3::from_array(position);
            coordinates_field.add(format_args!(
                "has {count} vertices that are not finite or more than {farthest} from 0 (1 km); the first is vertex \
                 {vertex}, {position}"
            ));
        }
        let vertices = coordinates.len();
        let exist = |corners: &[u32; 3]| corners.iter().all(|&corner| (corner as usize) < vertices);
        if let Some((count, triangle, [a, b, c])) = wrong(triangles, exist) {
            triangles_field.add(format_args!(
                "has {count} triangles with a vertex that does not exist; the first is triangle {triangle}, \
                 ({a}, {b}, {c}), and there are {vertices} vertices, counted from 0"
            ));
        }
        let client_from_wrist = mesh.client_from_wrist.map(|sent| {
            let sent = pose(field.child("client_from_wrist"), Some(sent), convention);
            convention.joint_to_openxr(sent)
        });
        let positions = coordinates
            .iter()
            .map(|&position| convention.point_to_openxr(position.into()));
        MeshedHand {
            positions: positions.collect(),
            triangles: triangles.to_vec(),
            client_from_wrist,
            field: field.to_string(),
        }
    })
}

/// A list as groups of three; empty if it is too long, which is a violation, as are an empty list and a rest.
fn threes<'a, T>(field: Field<'_>, list: &'a [T]) -> &'a [[T; 3]] {
    let (threes, rest) = list.as_chunks::<3>();
    let most = 3 * MAX_MESH;
    let is_right = field.check(
        rest.is_empty() && (1..=MAX_MESH).contains(&threes.len()),
        format_args!(
            "has {} numbers; it must have 3 to {most}, a multiple of 3",
            list.len()
        ),
    );
    if is_right { threes } else { &[] }
}

/// How many elements are wrong, and the first with its place; `None` if all are right.
fn wrong<T>(list: &[T], is_right: impl Fn(&T) -> bool) -> Option<(usize, usize, &T)> {
    let (place, first) = list.iter().enumerate().find(|(_, one)| !is_right(one))?;
    let count = list.iter().filter(|one| !is_right(one)).count();
    Some((count, place, first))
}

/// Checks how large all hands of a request are together.
pub(super) fn check_meshes_together<'h>(field: Field<'_>, hands: impl Iterator<Item = &'h GiverHand>) {
    let (mut vertices, mut triangles) = (0, 0);
    for hand in hands {
        if let GiverHand::Meshed(hand) = hand {
            vertices += hand.positions.len();
            triangles += hand.triangles.len();
        }
    }
    field.check(
        vertices.max(triangles) <= MAX_MESH,
        format_args!(
            "and holdout.presenting_hand have meshes of {vertices} vertices and {triangles} triangles in all; they may \
             have {MAX_MESH} of each"
        ),
    );
}
