//! Mirror images of hands.

use grasp_synthesis::propose::mirror::Mirror;

use crate::prelude::*;

fn off_centre() -> GraspObject {
    let centre = Vec3::new(0.0, -0.05, -0.03);
    GraspObject::new(cuboid(Vec3::splat(0.2), 1), 4.0, centre, None, &[]).expect("it is sound")
}

#[test]
fn mirror_image_of_a_hand_is_the_other_hand() {
    let object = off_centre();
    let [right, left] = [Handedness::Right, Handedness::Left].map(adult);
    let pose = hand_pose(
        Pose::new(
            Vec3::new(0.3, 0.1, -0.2),
            Quat::from_axis_angle(Vec3::new(0.36, 0.48, 0.8), 1.1),
        ),
        right.stretched(),
    );
    let mirror = Mirror::facing(&object, Vec3::Y, pose.frame_from_wrist.position).expect("it is aside");
    let image = HandPose {
        frame_from_wrist: mirror.wrist(pose.frame_from_wrist),
        ..pose
    };
    // The plane's normal is horizontal and points from the centre of mass at the wrist.
    let offset = pose.frame_from_wrist.position - object.centre_of_mass;
    let normal = Vec3::new(offset.x, 0.0, offset.z).normalize_or_zero();
    let reflected = |p: Vec3| p - 2.0 * (p - object.centre_of_mass).dot(normal) * normal;
    let original = HandSolids::of_pose(right, &pose);
    let mirrored = HandSolids::of_pose(left, &image);
    // The two solids of a forearm lie side by side, and change places.
    let forearms = original.forearm.iter().zip(mirrored.forearm.iter().rev());
    let others = original
        .iter()
        .zip(mirrored.iter())
        .take(original.iter().count() - 2);
    for (ours, theirs) in others.chain(forearms) {
        let TaperedCapsule { start, end, .. } = *theirs;
        assert!(reflected(ours.start).distance(start) < 1e-5 && reflected(ours.end).distance(end) < 1e-5);
        assert!((ours.start_radius - theirs.start_radius).abs() < 1e-6);
        assert!((ours.end_radius - theirs.end_radius).abs() < 1e-6);
    }
}

#[test]
fn no_upright_plane_faces_a_place_above_the_centre() {
    let object = off_centre();
    assert_eq!(
        Mirror::facing(&object, Vec3::Y, object.centre_of_mass + Vec3::Y),
        None
    );
}
