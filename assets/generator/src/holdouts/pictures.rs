//! Pictures of the holdouts: whether a grasp looks like its type can only be judged by eye.

use std::{fs, io, path::Path};

use glam::Vec3;
use grasp_assets::{hands::hand, holdouts::BuiltInHoldout, objects::object};
use grasp_scene::{Camera, Finish, Part, RenderOptions, Scene, contact_sheet, linear_from_srgb, render};
use grasp_synthesis::model::hand::joints::HandJoints;

/// Direction from the holdout to the camera: the receiver's view, the giver's right and left, and above.
const VIEWS: [(&str, Vec3); 4] = [
    ("from the receiver", Vec3::new(0.35, 0.35, 1.0)),
    ("from the giver's right", Vec3::new(-1.0, 0.25, 0.2)),
    ("from the giver's left", Vec3::new(1.0, 0.25, 0.2)),
    ("from above", Vec3::new(0.05, 1.0, -0.25)),
];

/// Writes a sheet of views for each holdout.
///
/// # Errors
/// A picture cannot be written.
pub(crate) fn pictures(holdouts: &[BuiltInHoldout], folder: &Path) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let options = RenderOptions {
        width: 560,
        height: 460,
        supersampling: 2,
        ..RenderOptions::default()
    };
    for holdout in holdouts {
        let scene = scene(holdout);
        let aspect = options.width as f32 / options.height as f32;
        let images: Vec<_> = VIEWS
            .iter()
            .map(|&(name, direction)| {
                let camera = Camera::framing(&scene, direction, Vec3::Y, aspect);
                let caption = format!("{} ({}), {name}", holdout.name, holdout.grasp_type);
                (render(&scene, &camera, options), caption)
            })
            .collect();
        let sheet = contact_sheet(&images, 2).expect("there are views");
        fs::write(folder.join(format!("{}.png", holdout.name)), sheet.to_png())?;
    }
    Ok(())
}

/// Object and giver in the world.
fn scene(holdout: &BuiltInHoldout) -> Scene {
    let built_in = object(&holdout.object).expect("the objects of the holdouts are built in");
    let giver = hand(&holdout.giver_rig, holdout.giver_handedness).expect("the rigs are built in");
    let mesh = built_in.object.surface.mesh();
    let placed = mesh
        .positions()
        .iter()
        .map(|&p| holdout.world_from_object.transform_point(p))
        .collect();
    let skin = giver
        .skin
        .posed(&HandJoints::of_pose(&giver.rig, &holdout.giver_pose()));
    Scene {
        parts: vec![
            Part::new(
                "object",
                placed,
                mesh.triangles().to_vec(),
                linear_from_srgb(90, 110, 140),
            ),
            Part::new(
                "giver",
                skin,
                giver.skin.triangles.clone(),
                linear_from_srgb(224, 172, 142),
            )
            .with_finish(Finish::Skin),
        ],
    }
}
