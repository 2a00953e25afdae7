//! The thesis' wrenches, force distributions, immobility and comfort against closed forms.

use grasp_synthesis::{
    model::forces::{COMFORTABLE_SHARES, GRAVITY},
    rating::scoring::comfort,
    thesis::{
        force_distribution::{ForceDistribution, contact_counts},
        immobility_validation::{DistributionChoice, Immobility, ImmobilityBuffers, Load},
        wrenches::{Wrench, four_unit_wrenches, printed_cone_cos},
    },
};

use crate::prelude::*;

/// A box of 4 cm between thumb and index finger, which press along x (the thesis' running example).
fn pinch() -> [Contact; 2] {
    [(-0.02, Digit::Thumb), (0.02, Digit::Index)].map(|(x, digit)| {
        let part = HandPart::Phalanx(digit, Phalanx::Third);
        contact(Vec3::X * x, (Vec3::X * x).normalize_or(Vec3::X), part)
    })
}

fn load(up: Vec3) -> Load {
    Load {
        gravity: Wrench::of_gravity(0.1, up),
        centre_of_mass: Vec3::ZERO,
        friction: THESIS_FRICTION,
    }
}

fn validate(
    contacts: &[Contact],
    load: &Load,
    choice: DistributionChoice,
    seed: u64,
) -> (Immobility, ImmobilityBuffers) {
    let mut buffers = ImmobilityBuffers::default();
    let result = buffers.validate(
        contacts,
        load,
        choice,
        &mut AttemptStream::new(seed, 0),
        Stop::NEVER,
    );
    (result.expect("nothing stops it"), buffers)
}

/// Wrenches of unit forces have unit forces, on the boundary of a cone of 70.1° that opens into the object, spread
/// evenly, with torques of lines that meet 3 mm outside the surface.
#[test]
fn four_wrenches_lie_on_the_printed_cone_and_point_inward() {
    let mut stream = AttemptStream::new(3, 0);
    let half_angle = f64::from(THESIS_FRICTION).acos();
    assert!((half_angle.to_degrees() - 70.12).abs() < 0.01);
    for _ in 0..200 {
        let normal = stream.in_cube().normalize_or(Vec3::Y);
        let position = stream.in_cube() * 0.1;
        let centre_of_mass = stream.in_cube() * 0.05;
        let touch = contact(position, normal, HandPart::Phalanx(Digit::Thumb, Phalanx::Second));
        let wrenches = four_unit_wrenches(&touch, centre_of_mass, printed_cone_cos(THESIS_FRICTION));
        let tip = position.as_dvec3() - centre_of_mass.as_dvec3() + normal.as_dvec3() * 0.003;
        let mut sum = Vec3::ZERO;
        for wrench in wrenches {
            let force = wrench.force.as_dvec3();
            assert!((force.length() - 1.0).abs() < 1e-5);
            let inward = -normal.as_dvec3();
            assert!((force.dot(inward).acos() - half_angle).abs() < 1e-4);
            assert!((wrench.torque.as_dvec3() - tip.cross(force)).length() < 1e-6);
            sum += wrench.force;
        }
        // Evenly spread: opposite pairs cancel across the normal, neighbours stand at right angles there.
        assert!((sum + normal * 4.0 * THESIS_FRICTION).length() < 1e-5);
        let across = wrenches.map(|wrench| wrench.force + normal * THESIS_FRICTION);
        assert!(across[0].dot(across[1]).abs() < 1e-5 && across[1].dot(across[2]).abs() < 1e-5);
    }
}

/// Shares: each digit gets its noisy share, split evenly over its contacts, and every four magnitudes sum to that.
#[test]
fn distributions_split_noisy_shares_evenly_over_contacts() {
    let [thumb, index] = pinch();
    let contacts = [
        thumb,
        Contact {
            part: HandPart::Phalanx(Digit::Index, Phalanx::First),
            ..index
        },
        Contact {
            part: HandPart::Phalanx(Digit::Index, Phalanx::Second),
            ..index
        },
        index,
        Contact {
            part: HandPart::Phalanx(Digit::Little, Phalanx::Third),
            ..index
        },
    ];
    assert_eq!(contact_counts(&contacts), [1, 3, 0, 0, 1]);
    let mut stream = AttemptStream::new(5, 9);
    let mut distribution = ForceDistribution::default();
    let mut mean = [0.0_f64; 4];
    let rounds = 4000;
    for _ in 0..rounds {
        distribution.sample(&contacts, contact_counts(&contacts), &mut stream);
        assert!(distribution.magnitudes.iter().flatten().all(|&m| m >= 0.0));
        let totals = distribution.digit_totals(&contacts);
        for (digit, total) in totals.into_iter().enumerate() {
            let ratio = total / COMFORTABLE_SHARES[digit];
            let touches = matches!(digit, 0 | 1 | 4);
            assert!(if touches {
                (0.499..=1.501).contains(&ratio)
            } else {
                total == 0.0
            });
        }
        let sums: Vec<f32> = distribution.magnitudes.iter().map(|m| m.iter().sum()).collect();
        assert!((sums[1] - sums[2]).abs() < 1e-6 && (sums[1] - sums[3]).abs() < 1e-6);
        for (mean, magnitude) in mean.iter_mut().zip(distribution.magnitudes[0]) {
            *mean += f64::from(magnitude / sums[0]) / f64::from(rounds);
        }
    }
    // Flat Dirichlet of four: every weight has mean 1/4 (deviation of the mean: 0.19 / √4000 = 0.003).
    assert!(mean.iter().all(|mean| (mean - 0.25).abs() < 0.015), "{mean:?}");
}

/// The wrench sum of a pinch is as large as gravity's and within 5° of opposing it.
#[test]
fn an_immobilizing_distribution_is_scaled_to_the_weight() {
    let load = load(Vec3::Y);
    let weight = 0.1 * GRAVITY;
    for choice in [DistributionChoice::Best, DistributionChoice::FirstSufficient] {
        let mut found = 0;
        for seed in 0..40 {
            let contacts = pinch();
            let (result, buffers) = validate(&contacts, &load, choice, seed);
            let Immobility::Immobilizing(angle) = result else {
                continue;
            };
            found += 1;
            let forces = buffers.forces();
            let force: Vec3 = forces.iter().sum();
            // The printed sum mixes newton metres with newtons, so the force alone may be slightly smaller.
            let torque_free = weight * 5.0_f32.to_radians().cos();
            assert!(force.length() <= weight * 1.0001 && force.length() >= torque_free * 0.999);
            let off = force.angle_between(Vec3::Y).to_degrees();
            assert!(off < 5.01 && off <= angle.to_degrees() + 0.05, "{off} {angle}");
            // Each force lies in its cone: the mean of forces on the boundary is inside.
            for (force, contact) in forces.iter().zip(&contacts) {
                assert!(force.dot(-contact.normal) >= force.length() * (THESIS_FRICTION - 1e-4));
            }
        }
        assert!(found >= 10, "only {found} of 40 pinches hold with {choice:?}");
    }
}

/// Eq. 4.6 by hand.
#[test]
fn comfort_matches_hand_computed_examples() {
    let near =
        |value: f32, expected: f32| assert!((value - expected).abs() < 1e-6, "{value}, not {expected}");
    // The comfortable distribution itself, in any unit.
    near(comfort([0.25, 0.25, 0.25, 0.125, 0.125]), 0.0);
    near(comfort([2.0, 2.0, 2.0, 1.0, 1.0]), 0.0);
    // Thumb and index alone: D' = (½, ½).
    near(comfort([3.0, 3.0, 0.0, 0.0, 0.0]), 0.0);
    // f = (¾, ¼): 2 · (¼)² = 0.125.
    near(comfort([3.0, 1.0, 0.0, 0.0, 0.0]), 0.125);
    // Thumb and little finger: Z = 0.375, D' = (⅔, ⅓); f = (½, ½): 2 · (⅙)² = 1/18.
    near(comfort([1.0, 0.0, 0.0, 0.0, 1.0]), 1.0 / 18.0);
    // Thumb, ring, little: Z = ½, D' = (½, ¼, ¼); f = (0.2, 0.4, 0.4): 0.09 + 2 · 0.0225 = 0.135.
    near(comfort([1.0, 0.0, 0.0, 2.0, 2.0]), 0.135);
}
