//! Pictures of grasps, framed by what the rules say of them.

use glam::Vec3;
use grasp_assets::hands::hand;
use grasp_scene::{ContactMark, Finish, HandoverScene, Image, PosedHand, RenderOptions, linear_from_srgb};
use grasp_synthesis::model::hand::{Handedness, joints::HandJoints};
use grasp_tests::pairs::{catalogue::Label, gathering::receiving_rig, pairing::Gathered};

/// Width and height of a picture in pixels, without its frame.
const SIZE: [u32; 2] = [320, 270];

/// Width of a frame in pixels.
const FRAME: usize = 5;

/// Colours of frames, sRGB.
pub(crate) const GREEN: [u8; 3] = [46, 139, 70];
pub(crate) const RED: [u8; 3] = [192, 48, 40];

/// The most informative view of a grasp in the world, +Y up. Blades are red.
pub(crate) fn picture(gathered: &Gathered, candidate: usize) -> Image {
    let offer = &gathered.offer;
    let world = offer.world_from_object;
    let grasp = &gathered.candidates[candidate].grasp;
    let skin = |handedness: Handedness| &hand("adult", handedness).expect("the adult rig is built in").skin;
    let labels = offer.object.labels.iter().zip(0_u32..);
    let blades: Vec<u32> = labels
        .filter(|(label, _)| **label == Label::Blade)
        .map(|(_, triangle)| triangle)
        .collect();
    let contacts = grasp.contacts.iter().zip(&grasp.forces);
    let scene = HandoverScene {
        forbidden: &blades,
        object_colour: linear_from_srgb(186, 176, 150),
        object_finish: Finish::Satin,
        giver: offer.giver_joints().map(|joints| PosedHand {
            skin: skin(joints.handedness),
            joints: joints.transformed(world),
        }),
        receiver: Some(PosedHand {
            skin: skin(Handedness::Right),
            joints: HandJoints::of_pose(receiving_rig(), &grasp.pose).transformed(world),
        }),
        contacts: contacts
            .map(|(contact, &force)| ContactMark {
                position: world.transform_point(contact.position),
                normal: world.transform_vector(contact.normal),
                force: world.transform_vector(force),
                digit: contact.part.digit(),
                phalanx: contact.part.phalanx(),
            })
            .collect(),
        ..HandoverScene::new(offer.object.object.surface.mesh(), world)
    };
    let [width, height] = SIZE;
    scene.render_best_view(RenderOptions {
        width,
        height,
        supersampling: 2,
        up: Vec3::Y,
    })
}

/// An image in a frame.
pub(crate) fn framed(image: &Image, colour: [u8; 3]) -> Image {
    let [width, height] = [image.width(), image.height()].map(|side| side + 2 * FRAME);
    let mut rgb = colour.repeat(width * height);
    for (row, pixels) in image.rgb().chunks_exact(3 * image.width()).enumerate() {
        let start = 3 * ((row + FRAME) * width + FRAME);
        rgb[start..start + pixels.len()].copy_from_slice(pixels);
    }
    Image::from_rgb(width, height, rgb)
}
