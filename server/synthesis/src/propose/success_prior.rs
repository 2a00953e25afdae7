//! How likely a hand is to hold where it comes to be, as far as that shows before it is closed: a small network, taught on
//! shapes that are drawn at random.
//!
//! What a hand meets when it is closed decides in the end, and takes a hundred times longer. The network knows of the
//! object's box and weight only how they lie in the hand, of its surface how thick it is between the pads, and of the
//! giver how near pads and palm are. That is enough to see that fingers hold a mug by its body or handle, and not by the
//! rim that most pairs of points lie on. What it was taught (`taught.rs`) comes from the assets' generator.

mod weights;

use glam::Vec3;

use super::opposition::Opposition;
use crate::{
    base::pose::Pose,
    model::{
        hand::{Handedness, rig::Rig},
        object::GraspObject,
    },
    physical::solids::PreparedHand,
};

/// Numbers that the network is told.
pub const INPUTS: usize = 23;

/// Units of the network's one hidden layer. Twice as many rate no better.
pub const UNITS: usize = 32;

/// How far from what it was taught, in standard deviations, a number may be told: further out, nothing was learned.
pub const FARTHEST: f32 = 3.0;

/// What is thinner or smaller than this is told as if it were this, in metres: logarithms have no zero.
const LEAST_SIZE: f32 = 0.001;

/// Farther than this, in metres, a giver's hand is as if it were not there.
const FAR: f32 = 0.1;

/// The network that was taught.
pub use crate::propose::success_prior::weights::TRAINED;

/// A network of one hidden layer of rectified units.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// What is told at the mean, …
    pub means: [f32; INPUTS],
    /// … and how many standard deviations one more of it is.
    pub scales: [f32; INPUTS],
    /// From what is told to each unit.
    pub weights: [[f32; UNITS]; INPUTS],
    /// Of each unit.
    pub biases: [f32; UNITS],
    /// From each unit to the answer.
    pub outputs: [f32; UNITS],
    /// Of the answer.
    pub output_bias: f32,
}

impl Network {
    /// What the hidden layer is told: in standard deviations from the mean, at most [`FARTHEST`].
    pub fn scaled(&self, inputs: &[f32; INPUTS]) -> [f32; INPUTS] {
        std::array::from_fn(|i| ((inputs[i] - self.means[i]) * self.scales[i]).clamp(-FARTHEST, FARTHEST))
    }

    /// The hidden units, told what is scaled already.
    pub fn units(&self, scaled: &[f32; INPUTS]) -> [f32; UNITS] {
        let mut units = self.biases;
        // Loops over indices, as zipped and mapped arrays stay calls.
        for (inputs, weights) in scaled.iter().zip(&self.weights) {
            for k in 0..UNITS {
                units[k] += inputs * weights[k];
            }
        }
        for unit in &mut units {
            *unit = unit.max(0.0);
        }
        units
    }

    /// The log odds that the hand holds.
    pub fn log_odds(&self, inputs: &[f32; INPUTS]) -> f32 {
        let units = self.units(&self.scaled(inputs));
        let weighted = units.iter().zip(&self.outputs);
        self.output_bias + weighted.map(|(unit, weight)| unit * weight).sum::<f32>()
    }
}

/// What the network is told of an object.
#[derive(Clone, Copy, Debug)]
pub struct ObjectFeatures {
    centre_of_mass: Vec3,
    /// Unit vector along the longest edges of its box.
    long_axis: Vec3,
    /// Logarithms of half its box's edges in metres, longest first.
    sizes: [f32; 3],
    /// Half the diagonal of its box, in metres.
    characteristic_length: f32,
}

impl ObjectFeatures {
    /// Of an object, in its frame.
    pub fn of(object: &GraspObject) -> Self {
        let around = &object.bounding_box;
        let mut axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| (around.half_extents.dot(axis), axis));
        axes.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        Self {
            centre_of_mass: object.centre_of_mass,
            long_axis: around.object_from_box.transform_vector(axes[0].1),
            sizes: axes.map(|(half, _)| half.max(LEAST_SIZE).ln()),
            characteristic_length: around.half_extents.length().max(LEAST_SIZE),
        }
    }

    /// What the network is told of a hand whose pads, opposed so, come to be at `object_from_wrist`, beside a giver's.
    pub fn inputs(
        &self,
        rig: &Rig,
        opposition: &Opposition,
        object_from_wrist: Pose,
        giver: Option<&PreparedHand>,
    ) -> [f32; INPUTS] {
        let wrist_from_object = object_from_wrist.inverse();
        let mut weight = wrist_from_object.transform_point(self.centre_of_mass);
        let long_axis = wrist_from_object.transform_vector(self.long_axis).abs();
        // How far the weight is from the line through the pads, and from the middle between them along it.
        let across = (opposition.fingers - opposition.thumb).normalize_or_zero();
        let arm = weight - (opposition.fingers + opposition.thumb) * 0.5;
        let along = arm.dot(across);
        let sideways = (arm - across * along).length();
        // The network was taught on right hands.
        if rig.handedness == Handedness::Left {
            weight.x = -weight.x;
        }
        let [from_thumb, from_fingers, from_palm] =
            [opposition.thumb, opposition.fingers, rig.palm].map(|point| {
                let point = object_from_wrist.transform_point(point);
                giver.map_or(FAR, |giver| {
                    giver.point_distance_upper_bound(point).clamp(0.0, FAR)
                })
            });
        let shape = &opposition.shape;
        let digits = shape.closing.iter().filter(|&&closes| closes).count();
        [
            opposition.width().max(LEAST_SIZE).ln(),
            sideways / self.characteristic_length,
            along.abs(),
            weight.x,
            weight.y,
            weight.z,
            long_axis.x,
            long_axis.y,
            long_axis.z,
            self.sizes[0],
            self.sizes[1],
            self.sizes[2],
            digits as f32,
            f32::from(u8::from(shape.tucks)),
            shape.thumb_yaw,
            shape.spread,
            shape.bend_ratios[0],
            shape.bend_ratios[1],
            opposition.closed[0],
            opposition.closed[1],
            from_thumb,
            from_fingers,
            from_palm,
        ]
    }
}
