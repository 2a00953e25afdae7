//! The built-in holdouts can be received, and their synthesized givers found again.

use grasp_assets::holdouts::Origin;

use crate::prelude::*;

#[test]
fn synthesized_givers_are_found_again_by_seed_and_attempt() {
    let rig = &built_in_hand("thesis", Handedness::Right).rig;
    for built_in in holdouts() {
        let Origin::Synthesized {
            seed,
            attempt,
            strategy,
            bend_ratios,
            friction,
            up,
        } = built_in.origin
        else {
            continue;
        };
        let name = &built_in.name;
        let gravity = built_in.world_from_object.inverse().transform_vector(Vec3::Y);
        assert!(gravity.distance(up) < 1e-5, "{name} {up} {gravity}");
        let free = Holdout {
            object: Arc::clone(object(&built_in.object)),
            presenting_hand: None,
            other_hands: Vec::new(),
            obstacles: Vec::new(),
            stance: Stance::default(),
            up,
        };
        let search = thesis(&free, strategy)
            .rig(rig)
            .seed(seed)
            .bend_ratios(bend_ratios)
            .friction(friction)
            .first_attempt(attempt)
            .max_attempts(1);
        let grasp = search
            .grasp()
            .unwrap_or_else(|| panic!("{name}: attempt {attempt} of seed {seed} finds nothing"));
        let recorded = built_in.giver_pose();
        assert_eq!(grasp.pose.digits, recorded.digits, "{name}");
        let found = grasp.pose.frame_from_wrist;
        let recorded = built_in.world_from_object.inverse() * recorded.frame_from_wrist;
        assert!(found.position.distance(recorded.position) < 1e-5, "{name}");
        assert!(
            found.orientation.dot(recorded.orientation).abs() > 1.0 - 1e-5,
            "{name}"
        );
    }
}

#[test]
fn a_receiver_finds_a_grasp_on_every_built_in_holdout() {
    let rig = &built_in_hand("thesis", Handedness::Right).rig;
    for built_in in holdouts() {
        let holdout = built_in.to_holdout().expect("the built-in holdout is sound");
        assert!((holdout.up.length() - 1.0).abs() < 1e-5, "{}", built_in.name);
        let search = thesis(&holdout, Strategy::F)
            .rig(rig)
            .seed(1)
            .friction(0.34)
            .reproducible(false)
            .max_attempts(2_000_000)
            .workers(2);
        let outcome = search.run();
        assert!(outcome.grasp.is_some(), "{}: {:?}", built_in.name, outcome.report);
    }
}
