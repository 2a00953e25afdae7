use std::fmt::Write as _;

use glam::{Mat3, Quat};
use grasp_assets::hands::hand;
use grasp_import::{Import, MeshLimits, read_mesh};
use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{Digit, HandPart, HandPose, Handedness, Phalanx},
};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::*;
use crate::pairs::catalogue::{About, labelled_object};

/// Triangles of a box in its OBJ text.
const OF_BOX: u32 = 12;

/// Two cuboids along x, each 15 cm long and 3 cm thick: `first` on the negative side, `second` on the positive one.
fn cuboids(first: &str, second: &str) -> String {
    let mut text = String::new();
    for (group, low) in [(first, -0.15), (second, 0.0)] {
        for corner in 0..8 {
            let side = |bit: i32| f64::from(corner >> bit & 1);
            let _ = writeln!(
                text,
                "v {} {} {}",
                low + 0.15 * side(0),
                0.03 * side(1) - 0.015,
                0.03 * side(2) - 0.015
            );
        }
        let _ = writeln!(text, "g {group}");
        for quad in [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ] {
            let [a, b, c, d] = quad.map(|corner: i32| corner - 8);
            let _ = writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}");
        }
    }
    text
}

/// A knife of two cuboids with its centre of mass in the middle.
fn knife(mass: f32, handles: &[&str], blades: &[&str]) -> LabelledObject {
    let limits = MeshLimits {
        bytes: 1 << 16,
        vertices: 1000,
        triangles: 1000,
    };
    let read = read_mesh(cuboids("handle", "blade").as_bytes(), Import::METRES, limits).unwrap();
    let about = About {
        mass,
        centre_of_mass: Some(Vec3::ZERO),
        friction: None,
        usual_up: Vec3::Y,
    };
    LabelledObject::new("knife", read, &about, handles, blades)
}

/// A hand at `wrist` whose fingers point along `fingers` and whose palm faces along `palm`, as far as that is across.
fn hand_at(wrist: Vec3, fingers: Vec3, palm: Vec3) -> HandJoints {
    let rig = &hand("adult", Handedness::Right).unwrap().rig;
    let y = fingers.normalize_or_zero();
    let z = palm.reject_from(y).normalize_or_zero();
    let pose = HandPose {
        frame_from_wrist: Pose::new(wrist, Quat::from_mat3(&Mat3::from_cols(y.cross(z), y, z))),
        digits: rig.stretched(),
    };
    HandJoints::of_pose(rig, &pose)
}

/// A contact of a digit, or of the palm, on a cuboid at this x.
fn contact(cuboid: u32, x: f32, digit: Option<Digit>) -> Contact {
    Contact {
        position: Vec3::new(x, 0.015, 0.0),
        normal: Vec3::Y,
        triangle: cuboid * OF_BOX,
        part: digit.map_or(HandPart::Palm, |digit| HandPart::Phalanx(digit, Phalanx::Third)),
    }
}

/// So many contacts on handle and blade, of different digits and about the middle.
fn contacts(on_handle: usize, on_blade: usize) -> Vec<Contact> {
    let cuboids = [vec![0; on_handle], vec![1; on_blade]].concat();
    let digits = Digit::ALL.into_iter().cycle();
    cuboids
        .into_iter()
        .zip(digits)
        .map(|(cuboid, digit)| contact(cuboid, 0.0, Some(digit)))
        .collect()
}

/// A hand from above that approaches across the x axis.
fn usual() -> HandJoints {
    hand_at(Vec3::new(0.0, 0.1, -0.1), Vec3::Z, Vec3::NEG_Y)
}

/// A giver's hand far away from the knife, whose forearm extends from the wrist along −x.
fn distant_giver() -> HandJoints {
    hand_at(Vec3::new(-1.0, 0.0, 0.0), Vec3::X, Vec3::Y)
}

#[test]
fn a_forearm_beside_the_givers_is_implausible() {
    let knife = knife(0.2, &["handle"], &[]);
    let giver = distant_giver();
    let rules = Rules::new(&knife, Some(&giver), Vec3::Y);
    let of = |fingers: Vec3| {
        let hand = hand_at(Vec3::ZERO, fingers, Vec3::NEG_Z);
        rules.verdicts(&hand, &contacts(4, 0)).of(Reason::GiversSide)
    };
    let at = |degrees: f32| Vec3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0);
    assert_eq!(of(Vec3::X), Verdict::Implausible);
    assert_eq!(of(at(55.0)), Verdict::Implausible);
    assert_eq!(of(at(80.0)), Verdict::Undecided);
    assert_eq!(of(at(110.0)), Verdict::Plausible);
    // Downward fingers have an elbow above the hand.
    assert_eq!(of(at(-110.0)), Verdict::Undecided);
    assert_eq!(of(Vec3::NEG_X), Verdict::Plausible);
    let alone = Rules::new(&knife, None, Vec3::Y).verdicts(&usual(), &contacts(4, 0));
    assert_eq!(alone.of(Reason::GiversSide), Verdict::Inapplicable);
}

#[test]
fn what_is_held_at_a_free_handle_is_plausible() {
    let knife = knife(0.2, &["handle"], &[]);
    let of = |giver: Option<&HandJoints>, on_handle, elsewhere| {
        let rules = Rules::new(&knife, giver, Vec3::Y);
        rules
            .verdicts(&usual(), &contacts(on_handle, elsewhere))
            .of(Reason::OffHandle)
    };
    let giver = distant_giver();
    for giver in [None, Some(&giver)] {
        assert_eq!(of(giver, 0, 3), Verdict::Implausible);
        assert_eq!(of(giver, 1, 4), Verdict::Implausible);
        assert_eq!(of(giver, 2, 2), Verdict::Undecided);
        assert_eq!(of(giver, 4, 1), Verdict::Plausible);
    }
    // Fingers along all of the handle leave no room on it.
    let on_handle = hand_at(Vec3::new(-0.2, 0.01, 0.0), Vec3::X, Vec3::NEG_Y);
    assert_eq!(of(Some(&on_handle), 0, 3), Verdict::Inapplicable);
}

#[test]
fn the_free_share_is_that_of_random_points() {
    let knife = knife(0.2, &["handle"], &[]);
    let giver = hand_at(Vec3::new(-0.2, 0.01, -0.1), Vec3::new(1.0, 0.0, 0.7), Vec3::NEG_Y);
    let found = free_share(&knife, Label::Handle, &giver);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let triangles: Vec<_> = knife.triangles_of(Label::Handle).collect();
    let area = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).length();
    let (mut free, mut whole) = (0.0, 0.0);
    for &[a, b, c] in &triangles {
        for _ in 0..2000 {
            let [mut u, mut v] = [random.random::<f32>(), random.random::<f32>()];
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let is_free = distance_from_skin(&giver, a + u * (b - a) + v * (c - a)) > FINGER_ROOM;
            whole += area([a, b, c]);
            free += if is_free { area([a, b, c]) } else { 0.0 };
        }
    }
    assert!((0.1..0.9).contains(&found), "{found}");
    assert!(
        (found - free / whole).abs() < 0.02,
        "{found}, not {}",
        free / whole
    );
    assert_eq!(free_share(&knife, Label::Handle, &distant_giver()), 1.0);
}

#[test]
fn a_blade_is_not_touched_unless_the_giver_has_the_handle() {
    let knife = knife(0.2, &["handle"], &["blade"]);
    let of = |giver: Option<&HandJoints>, on_handle, on_blade| {
        Rules::new(&knife, giver, Vec3::Y).verdicts(&usual(), &contacts(on_handle, on_blade))
    };
    assert_eq!(of(None, 4, 0).of(Reason::OnBlade), Verdict::Plausible);
    assert_eq!(of(None, 4, 1).of(Reason::OnBlade), Verdict::Undecided);
    assert_eq!(of(None, 3, 1).of(Reason::OnBlade), Verdict::Implausible);
    // The blade is the only reason then.
    assert_eq!(of(None, 0, 4).only_reason(), Some(Reason::OnBlade));
    let on_handle = hand_at(Vec3::new(-0.2, 0.01, 0.0), Vec3::X, Vec3::NEG_Y);
    assert_eq!(
        of(Some(&on_handle), 0, 4).of(Reason::OnBlade),
        Verdict::Inapplicable
    );
}

#[test]
fn long_things_are_taken_across() {
    let plain = knife(0.2, &[], &[]);
    let of = |object: &LabelledObject, fingers, palm| {
        let hand = hand_at(Vec3::ZERO, fingers, palm);
        Rules::new(object, None, Vec3::Y)
            .verdicts(&hand, &contacts(2, 2))
            .of(Reason::EndOn)
    };
    let [ahead, down] = [Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, -1.0, 0.0)];
    assert_eq!(of(&plain, ahead, down), Verdict::Implausible);
    assert_eq!(of(&plain, Vec3::Z, Vec3::NEG_Y), Verdict::Plausible);
    assert_eq!(
        of(&plain, Vec3::new(1.0, 0.2, 0.0), Vec3::NEG_Y),
        Verdict::Implausible
    );
    assert_eq!(
        of(&plain, Vec3::new(1.0, 0.0, 0.6), Vec3::NEG_Y),
        Verdict::Undecided
    );
    // A handle along the knife is held across, too.
    assert_eq!(
        of(&knife(0.2, &["handle"], &[]), ahead, down),
        Verdict::Implausible
    );
    let giver = distant_giver();
    let held = Rules::new(&plain, Some(&giver), Vec3::Y).verdicts(&usual(), &contacts(2, 2));
    assert_eq!(held.of(Reason::EndOn), Verdict::Inapplicable);
}

#[test]
fn the_handle_says_what_is_across() {
    let long_axis = |name| Rules::new(&labelled_object(name).unwrap(), None, Vec3::Y).long_axis;
    assert_eq!(long_axis("hammer"), Some(Vec3::X));
    // A saw's handle is a ring at its end.
    assert_eq!(long_axis("saw"), None);
    assert_eq!(long_axis("large-bottle"), Some(Vec3::Y));
    assert_eq!(long_axis("brick"), Some(Vec3::X));
    // Short things are pinched from anywhere.
    assert_eq!(long_axis("key"), None);
}

#[test]
fn hands_come_from_the_side_or_from_above() {
    let knife = knife(0.2, &[], &[]);
    let of = |wrist, fingers, palm, up| {
        let hand = hand_at(wrist, fingers, palm);
        Rules::new(&knife, None, up)
            .verdicts(&hand, &contacts(2, 2))
            .of(Reason::FromBeneath)
    };
    let above = Vec3::new(0.0, 0.1, -0.1);
    assert_eq!(of(above, Vec3::Z, Vec3::NEG_Y, Vec3::Y), Verdict::Plausible);
    // The same hand, if down is up.
    assert_eq!(of(above, Vec3::Z, Vec3::NEG_Y, Vec3::NEG_Y), Verdict::Implausible);
    // A level palm at the end of an arm from below.
    let below = Vec3::new(0.0, -0.1, 0.0);
    assert_eq!(of(below, Vec3::Y, Vec3::Z, Vec3::Y), Verdict::Implausible);
    // A palm that faces up by 30°.
    let palm = Vec3::new(0.0, 0.5, 0.866);
    assert_eq!(
        of(Vec3::new(0.1, 0.0, 0.0), Vec3::NEG_X, palm, Vec3::Y),
        Verdict::Undecided
    );
}

#[test]
fn heavy_things_take_four_digits_or_the_palm() {
    let of = |mass, contacts: &[Contact]| {
        let knife = knife(mass, &[], &[]);
        Rules::new(&knife, None, Vec3::Y)
            .verdicts(&usual(), contacts)
            .of(Reason::TooFewDigits)
    };
    assert_eq!(of(1.5, &contacts(3, 0)), Verdict::Implausible);
    assert_eq!(of(1.5, &contacts(4, 0)), Verdict::Plausible);
    let palm = [contacts(2, 0), vec![contact(0, 0.0, None)]].concat();
    assert_eq!(of(1.5, &palm), Verdict::Plausible);
    // Three contacts of one digit.
    assert_eq!(
        of(1.5, &[contact(0, 0.0, Some(Digit::Thumb)); 3]),
        Verdict::Implausible
    );
    assert_eq!(of(0.5, &contacts(2, 0)), Verdict::Undecided);
    assert_eq!(of(0.5, &contacts(3, 0)), Verdict::Plausible);
    assert_eq!(of(0.05, &contacts(2, 0)), Verdict::Inapplicable);
}

#[test]
fn things_without_a_handle_are_held_near_their_middle_if_it_is_free() {
    let of = |object: &LabelledObject, giver: Option<&HandJoints>, x| {
        let at = Digit::ALL.map(|digit| contact(0, x, Some(digit)));
        Rules::new(object, giver, Vec3::Y)
            .verdicts(&usual(), &at)
            .of(Reason::FarEnd)
    };
    let plain = knife(0.2, &[], &[]);
    assert_eq!(of(&plain, None, -0.12), Verdict::Implausible);
    assert_eq!(of(&plain, None, 0.08), Verdict::Undecided);
    assert_eq!(of(&plain, None, 0.03), Verdict::Plausible);
    let giver = distant_giver();
    assert_eq!(of(&plain, Some(&giver), 0.12), Verdict::Implausible);
    let in_the_middle = hand_at(Vec3::new(-0.1, 0.0, 0.0), Vec3::X, Vec3::NEG_Y);
    assert_eq!(of(&plain, Some(&in_the_middle), 0.12), Verdict::Inapplicable);
    assert_eq!(
        of(&knife(0.2, &["handle"], &[]), None, -0.12),
        Verdict::Inapplicable
    );
    assert_eq!(of(&knife(0.05, &[], &[]), None, -0.12), Verdict::Inapplicable);
}

#[test]
fn a_reason_is_the_only_one_and_plausible_grasps_have_none_nor_doubts() {
    use Verdict::{Implausible, Inapplicable, Plausible, Undecided};
    let of = |verdicts: &[Verdict]| {
        let mut all = [Inapplicable; REASONS];
        all[..verdicts.len()].copy_from_slice(verdicts);
        let verdicts = Verdicts(all);
        (verdicts.are_plausible(), verdicts.only_reason())
    };
    assert_eq!(of(&[]), (false, None));
    assert_eq!(of(&[Plausible, Inapplicable, Plausible]), (true, None));
    assert_eq!(of(&[Plausible, Undecided]), (false, None));
    assert_eq!(of(&[Undecided, Implausible]), (false, Some(Reason::OffHandle)));
    assert_eq!(of(&[Implausible, Implausible]), (false, None));
}
