//! Moving pictures: a handover drawn at regular times, as an animated PNG file.

use glam::Vec3;

use crate::{
    camera::best_view,
    glb::MovingHandover,
    hands::PosedHand,
    image::{Image, to_animated_png},
    parts::Part,
    render::{Stage, ViewSize, render},
};

/// Pictures per second: enough for a page, which has to load them.
const RATE: f32 = 10.0;

/// Moments that the camera frames together.
const FRAMED: usize = 6;

/// A moving handover as an animated PNG file, from one camera, in an endless loop.
pub(crate) fn to_picture(handover: &MovingHandover, size: ViewSize) -> Vec<u8> {
    let moments = moments(&handover.times);
    let scenes: Vec<Vec<Part>> = moments.iter().map(|&moment| parts(handover, moment)).collect();
    let step = scenes.len().div_ceil(FRAMED).max(1);
    let framed: Vec<Part> = scenes.iter().step_by(step).flatten().cloned().collect();
    let camera = best_view(&framed, &Stage::new(&framed), importance, Vec3::Y, size.aspect());
    let drawn = |parts: &Vec<Part>| render(&Stage::new(parts), &camera, size, Vec3::Y);
    let images: Vec<Image> = scenes.iter().map(drawn).collect();
    to_animated_png(&images, RATE as u16)
}

/// The last moment before each picture.
fn moments(times: &[f32]) -> Vec<usize> {
    let count = times.last().map_or(0, |last| (last * RATE) as usize + 1);
    let at = |picture: usize| times.partition_point(|&time| time <= picture as f32 / RATE);
    (0..count).map(|picture| at(picture).saturating_sub(1)).collect()
}

fn parts(handover: &MovingHandover, moment: usize) -> Vec<Part> {
    let mut parts = vec![handover.object.clone().moved(handover.client_from_object[moment])];
    for hand in &handover.hands {
        if let Some(joints) = hand.joints[moment].clone() {
            let posed = PosedHand {
                skin: hand.skin,
                joints,
            };
            parts.extend(posed.parts(&hand.name, hand.person, None));
        }
    }
    parts
}

fn importance(part: &Part) -> f32 {
    match part.name.as_str() {
        "object" => 2.0,
        name if name.ends_with("_hand") => 1.0,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_picture_shows_the_last_moment_before_it() {
        let times: Vec<f32> = (0..=90).map(|frame| frame as f32 / 90.0).collect();
        let moments = moments(&times);
        assert_eq!(moments.len(), 11);
        assert!(
            moments
                .iter()
                .zip(0..)
                .all(|(&moment, picture)| moment.abs_diff(9 * picture) <= 1)
        );
    }
}
