//! Contacts for tests, known or random with fixed seeds.

use glam::{DVec3, Quat, Vec3};
use grasp_synthesis::{
    model::hand::Digit,
    physical::immobility::{Load, SoftContact},
};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Random geometry.
pub(crate) struct Random(Xoshiro256PlusPlus);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.0.random::<f32>()
    }

    pub(crate) fn index(&mut self, count: usize) -> usize {
        self.0.random_range(0..count)
    }

    pub(crate) fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::from_array([(); 3].map(|()| self.between(-1.0, 1.0)));
            if (0.01..=1.0).contains(&v.length_squared()) {
                return v.normalize_or(Vec3::X);
            }
        }
    }

    pub(crate) fn rotation(&mut self) -> Quat {
        Quat::from_axis_angle(self.direction(), self.between(0.0, std::f32::consts::PI))
    }

    /// Six independent numbers of one normal distribution at length one: a uniform direction of wrenches.
    pub(crate) fn wrench_direction(&mut self) -> [f64; 6] {
        let mut v = [0.0_f64; 6];
        for pair in v.chunks_exact_mut(2) {
            let radius = (-2.0 * f64::from(self.between(1e-7, 1.0)).ln()).sqrt();
            let (sin, cos) = f64::from(self.between(0.0, std::f32::consts::TAU)).sin_cos();
            pair[0] = radius * cos;
            pair[1] = radius * sin;
        }
        unit(v)
    }

    /// Contacts anywhere on an ellipsoid, with its normals.
    pub(crate) fn contacts(&mut self, count: usize) -> Vec<SoftContact> {
        let half = Vec3::new(0.03, 0.05, 0.02);
        let friction = self.between(0.3, 1.0);
        (0..count)
            .map(|k| {
                let on_sphere = self.direction();
                SoftContact {
                    position: on_sphere * half,
                    normal: (on_sphere / half).normalize_or(Vec3::X),
                    digit: (k < 5 || self.index(2) == 0).then(|| Digit::ALL[k % 5]),
                    friction,
                    torsion_radius: self.between(0.0, 0.008),
                }
            })
            .collect()
    }
}

pub(crate) fn unit(v: [f64; 6]) -> [f64; 6] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}

/// A thumb and fingers in turn that push `-normal` at each position.
pub(crate) fn contacts_at(places: &[(Vec3, Vec3)], friction: f32, torsion_radius: f32) -> Vec<SoftContact> {
    places
        .iter()
        .enumerate()
        .map(|(k, &(position, normal))| SoftContact {
            position,
            normal,
            digit: Some(Digit::ALL[k % 5]),
            friction,
            torsion_radius,
        })
        .collect()
}

/// A load with its centre of mass in the origin.
pub(crate) fn load(mass: f32, up: Vec3, characteristic_length: f32) -> Load {
    Load {
        mass,
        centre_of_mass: Vec3::ZERO,
        up,
        characteristic_length,
    }
}

/// Everything turned and moved alike.
pub(crate) fn moved(contacts: &[SoftContact], load: &Load, turn: Quat, by: Vec3) -> (Vec<SoftContact>, Load) {
    let contacts = contacts
        .iter()
        .map(|contact| SoftContact {
            position: turn * contact.position + by,
            normal: turn * contact.normal,
            ..*contact
        })
        .collect();
    let load = Load {
        centre_of_mass: turn * load.centre_of_mass + by,
        up: turn * load.up,
        ..*load
    };
    (contacts, load)
}

/// Everything larger by a factor.
pub(crate) fn scaled(contacts: &[SoftContact], load: &Load, factor: f32) -> (Vec<SoftContact>, Load) {
    let contacts = contacts
        .iter()
        .map(|contact| SoftContact {
            position: contact.position * factor,
            torsion_radius: contact.torsion_radius * factor,
            ..*contact
        })
        .collect();
    let load = Load {
        centre_of_mass: load.centre_of_mass * factor,
        characteristic_length: load.characteristic_length * factor,
        ..*load
    };
    (contacts, load)
}

/// How far the unit wrenches of the contacts reach along a direction, by trying pushes all over the limit surface of
/// each: from below, by less than 1 %.
pub(crate) fn sampled_reach(contacts: &[SoftContact], load: &Load, direction: &[f64; 6]) -> f64 {
    let mut best = f64::NEG_INFINITY;
    for contact in contacts {
        let inward = -contact.normal.as_dvec3();
        let (right, forward) = inward.any_orthonormal_pair();
        let arm = (contact.position - load.centre_of_mass).as_dvec3();
        for i in 0..36 {
            let around = f64::from(i) * 10.0_f64.to_radians();
            for j in -9..=9 {
                let (torsion, across) = (f64::from(j) * 10.0_f64.to_radians()).sin_cos();
                let force = inward
                    + (right * around.cos() + forward * around.sin()) * across * f64::from(contact.friction);
                let torque = arm.cross(force) + inward * torsion * f64::from(contact.torsion_radius);
                let torque = torque / f64::from(load.characteristic_length);
                let [a, b, c, d, e, f] = *direction;
                best = best.max(force.dot(DVec3::new(a, b, c)) + torque.dot(DVec3::new(d, e, f)));
            }
        }
    }
    best
}

/// Unit wrenches of pushes along some edges of each friction cone, and of pure torsion either way, or of
/// the push along the normal for a point contact.
pub(crate) fn pyramid_wrenches(contacts: &[SoftContact], load: &Load, edges: u32) -> Vec<[f64; 6]> {
    let mut wrenches = Vec::new();
    for contact in contacts {
        let inward = -contact.normal.as_dvec3();
        let (right, forward) = inward.any_orthonormal_pair();
        let arm = (contact.position - load.centre_of_mass).as_dvec3();
        let mut add = |across: DVec3, torsion: f64| {
            let force = inward + across * f64::from(contact.friction);
            let torque = arm.cross(force) + inward * (torsion * f64::from(contact.torsion_radius));
            let torque = torque / f64::from(load.characteristic_length);
            wrenches.push([force.x, force.y, force.z, torque.x, torque.y, torque.z]);
        };
        for edge in 0..edges {
            let (sin, cos) = (f64::from(edge) * std::f64::consts::TAU / f64::from(edges)).sin_cos();
            add(right * cos + forward * sin, 0.0);
        }
        if contact.torsion_radius > 0.0 {
            add(DVec3::ZERO, 1.0);
            add(DVec3::ZERO, -1.0);
        } else {
            add(DVec3::ZERO, 0.0);
        }
    }
    wrenches
}
