//! A contact sheet of valid grasps in the order of comfort E (thesis 4.6 and 6.1: would a person agree with it?).

use glam::Vec3;
use grasp_assets::hands::hand;
use grasp_scene::{ContactMark, HandoverScene, Image, PosedHand, RenderOptions, contact_sheet};
use grasp_synthesis::model::hand::joints::HandJoints;

use crate::{
    data::Data,
    make::{Maker, receiving_hand},
    plan::Set,
    record::Record,
    tables::valid_with_figures,
};

/// Grasps per object on the sheet. More are harder to look at, fewer show less of the order.
const GRASPS_PER_OBJECT: usize = 12;

/// Grasps per row.
const COLUMNS: usize = 6;

/// Width and height of a picture in pixels.
const SIZE: [u32; 2] = [330, 280];

/// Grasps of a set by object, from the most comfortable to the least and spread evenly over the ranks. None if the set
/// has no grasps.
pub fn comfort_sheet(data: &Data<'_>, maker: &Maker, set: Set) -> Option<Image> {
    let mut grasps: Vec<_> = valid_with_figures(data, set)
        .map(|(record, _, figures)| (record, figures.comfort))
        .collect();
    grasps.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    let mut objects: Vec<&str> = Vec::new();
    for &holdout in &data.settings.holdouts {
        let object = grasp_assets::holdouts::holdouts()[holdout].object.as_str();
        if !objects.contains(&object) {
            objects.push(object);
        }
    }
    let mut pictures = Vec::new();
    for object in objects {
        let own: Vec<_> = grasps
            .iter()
            .filter(|(record, _)| record.cell.built_in().object == object)
            .collect();
        for index in evenly(own.len(), GRASPS_PER_OBJECT) {
            let (record, comfort) = own[index];
            let caption = format!("E {comfort:.4}  {}", record.cell.built_in().name);
            pictures.push((picture(maker, record)?, caption));
        }
    }
    contact_sheet(&pictures, COLUMNS)
}

/// Up to `places` indices below `count`, evenly from the first to the last.
fn evenly(count: usize, places: usize) -> Vec<usize> {
    if count <= places {
        return (0..count).collect();
    }
    (0..places)
        .map(|place| place * (count - 1) / (places - 1))
        .collect()
}

/// A reproduced grasp, drawn in the world, with gravity downward.
fn picture(maker: &Maker, record: &Record) -> Option<Image> {
    let grasp = maker.grasp_of(record)?;
    let built_in = record.cell.built_in();
    let object = &grasp_assets::objects::object(&built_in.object)?.object;
    let giver = hand(&built_in.giver_rig, built_in.giver_handedness)?;
    let receiver = receiving_hand(record.cell.set)?;
    let world_from_object = built_in.world_from_object;
    let forbidden: Vec<u32> = (0..object.surface.mesh().triangles().len() as u32)
        .filter(|&triangle| object.is_forbidden(triangle))
        .collect();
    let mark = |(contact, force): (&grasp_synthesis::model::grasp::Contact, &Vec3)| ContactMark {
        position: world_from_object.transform_point(contact.position),
        normal: world_from_object.transform_vector(contact.normal),
        force: world_from_object.transform_vector(*force),
        digit: contact.part.digit(),
        phalanx: contact.part.phalanx(),
    };
    let scene = HandoverScene {
        forbidden: &forbidden,
        giver: Some(PosedHand {
            skin: &giver.skin,
            joints: HandJoints::of_pose(&giver.rig, &built_in.giver_pose()),
        }),
        receiver: Some(PosedHand {
            skin: &receiver.skin,
            joints: HandJoints::of_pose(&receiver.rig, &grasp.pose).transformed(world_from_object),
        }),
        contacts: grasp.contacts.iter().zip(&grasp.forces).map(mark).collect(),
        ..HandoverScene::new(object.surface.mesh(), world_from_object)
    };
    let [width, height] = SIZE;
    Some(scene.render_best_view(RenderOptions {
        width,
        height,
        up: Vec3::Y,
        ..RenderOptions::default()
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_are_spread_from_the_first_to_the_last() {
        assert_eq!(evenly(3, 12), [0, 1, 2]);
        assert_eq!(evenly(100, 4), [0, 33, 66, 99]);
        assert!(evenly(0, 12).is_empty());
    }
}
