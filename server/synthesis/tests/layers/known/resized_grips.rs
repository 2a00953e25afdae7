//! Known grips as starts for the same object at another size.

use grasp_synthesis::{known::seed_source::ResizedGrips, model::plain_object::ResizeError};

use crate::prelude::*;

const SCALES: [f32; 4] = [0.5, 0.8, 1.25, 2.0];

#[test]
fn a_resized_object_is_what_its_scaled_mesh_makes() {
    for name in OBJECT_NAMES {
        let original = object(name);
        for scale in SCALES {
            let resized = resized(original, scale);
            let mesh = resized.surface.mesh();
            assert_eq!(mesh.triangles(), original.surface.mesh().triangles());
            for (new, old) in mesh.positions().iter().zip(original.surface.mesh().positions()) {
                assert!(new.distance(*old * scale) <= 1e-6 * scale);
            }
            // The box is as tight as one that is fitted again.
            let volume = |of: &OrientedBox| of.half_extents.element_product();
            let fitted = OrientedBox::around(mesh);
            assert!(
                (volume(&resized.bounding_box) / volume(&fitted) - 1.0).abs() < 0.01,
                "{name} {scale}"
            );
            let outside = |position: &Vec3| resized.bounding_box.signed_distance(*position);
            assert!(mesh.positions().iter().map(outside).all(|by| by < 1e-5));
            assert_eq!(resized.forbidden_count(), original.forbidden_count());
            assert_eq!(resized.centre_of_mass, original.centre_of_mass * scale);
        }
    }
}

#[test]
fn a_size_at_which_mass_or_mesh_vanish_is_refused() {
    let object = object("remote");
    let refused = |scale, mass| {
        object
            .resized_until(scale, mass, Stop::NEVER)
            .expect("nothing stops it")
    };
    assert!(matches!(refused(1.0, 0.0), Err(ResizeError::Mass(_))));
    assert!(matches!(refused(2.0, f32::INFINITY), Err(ResizeError::Mass(_))));
    assert!(matches!(refused(1e-30, 0.1), Err(ResizeError::Mesh(_))));
    assert!(matches!(refused(1e38, 0.1), Err(ResizeError::Mesh(_))));
}

fn middle(entry: &Entry, is_counted: impl Fn(HandPart) -> bool) -> Option<Vec3> {
    let counted: Vec<Vec3> = entry
        .contacts
        .iter()
        .filter(|contact| is_counted(contact.part))
        .map(|contact| contact.position)
        .collect();
    (!counted.is_empty()).then(|| counted.iter().sum::<Vec3>() / counted.len() as f32)
}

#[test]
fn contacts_stay_on_the_surface_and_hands_where_they_hold_it() {
    let atlas = complete_atlas("scissors");
    for scale in SCALES {
        let resized_object = resized(object("scissors"), scale);
        for entry in atlas.entries().iter().step_by(50) {
            let moved = entry.on_resized(scale);
            for contact in &moved.contacts {
                let nearest = resized_object
                    .surface
                    .closest_point_within(contact.position, 1e-3 * scale);
                let distance = nearest.map(|nearest| nearest.distance);
                assert!(distance.is_some_and(|d| d < 2e-4 * scale), "{scale} {distance:?}");
            }
            // Seen from the wrist, the palm's contacts, or else all, are where they were.
            let from_wrist = |of: &Entry| {
                let place = middle(of, |part| part == HandPart::Palm).or_else(|| middle(of, |_| true));
                let wrist_from_object = of.grip.pose.frame_from_wrist.inverse();
                wrist_from_object.transform_point(place.expect("it touches"))
            };
            assert!(from_wrist(entry).distance(from_wrist(&moved)) < 1e-5);
            assert_eq!(entry.grip.pose.digits, moved.grip.pose.digits);
        }
    }
}

#[test]
fn grips_are_the_first_that_meet_the_requirements() {
    let atlas = complete_atlas("remote");
    let requirements = Requirements::default();
    let grips = ResizedGrips::new(Arc::clone(&atlas), 1.25);
    let of = |order: &[u16], stopped: bool| {
        grips.away_from(
            order.iter().copied(),
            right(),
            Barriers::NONE,
            &requirements,
            Stop::when(&|| stopped),
        )
    };
    let selected = of(&[7, 3, 5], false).expect("nothing stops it");
    let expected = [7, 3, 5].map(|entry: usize| atlas.entries()[entry].on_resized(1.25));
    assert_eq!(selected.entries(), expected);
    assert!(of(&[7], true).is_err());
}

/// How many of some seeds find a grasp within so many attempts.
fn found(scale: f32, seeds: &SeedSource, attempts: u64) -> usize {
    let holdout = floating(resized(object("scissors"), scale));
    let finds = |seed: &u64| {
        guided(&holdout)
            .seed(*seed)
            .seeds(seeds.clone())
            .max_attempts(attempts)
            .grasp()
            .is_some()
    };
    (0..40).filter(finds).count()
}

#[test]
fn searches_from_grips_of_another_size_succeed_more_often() {
    let atlas: Arc<Atlas> = complete_atlas("scissors");
    let (mut with, mut without) = (0, 0);
    for scale in SCALES {
        let resized = SeedSource::Resized(ResizedGrips::new(Arc::clone(&atlas), scale));
        let counts = [&resized, &SeedSource::Nothing].map(|seeds| found(scale, seeds, 4));
        println!("{scale}: {counts:?} of 40 with and without known grips");
        with += counts[0];
        without += counts[1];
    }
    assert!(with > without, "{with} with known grips, {without} without");
}
