//! The success prior: a small network, trained on random shapes, that estimates how likely a hand is to hold before it is closed.
//! Closing the hand decides, but takes a hundred times longer. Its weights are data in `weights.txt`; `assets/PROVENANCE.md`
//! describes their training.

use std::sync::LazyLock;

use glam::Vec3;

use super::opposition::Opposition;
use crate::{
    base::pose::Pose,
    model::{
        hand::{Handedness, rig::Rig},
        object::GraspObject,
    },
    physical::barriers::Barriers,
};

/// Number of inputs of the network.
pub const INPUTS: usize = 23;

/// Units of the hidden layer. Twice as many rank candidates no better.
pub const UNITS: usize = 32;

/// Largest standardized input, in standard deviations from the training mean; beyond it, the network has learned nothing.
pub const MAX_DEVIATION: f32 = 3.0;

/// Lower bound on lengths before taking their logarithm, in metres.
const MIN_SIZE: f32 = 0.001;

/// Distance in metres from which a giver's hand counts as absent.
const MAX_GIVER_DISTANCE: f32 = 0.1;

/// A network with one hidden layer of rectified linear units.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// Mean of each input in training.
    pub means: [f32; INPUTS],
    /// Reciprocal of each input's standard deviation in training.
    pub scales: [f32; INPUTS],
    /// Weight from each input to each hidden unit.
    pub weights: [[f32; UNITS]; INPUTS],
    /// Bias of each hidden unit.
    pub biases: [f32; UNITS],
    /// Weight from each hidden unit to the output.
    pub outputs: [f32; UNITS],
    /// Bias of the output.
    pub output_bias: f32,
}

/// The network trained on hands of the rig `adult` and random shapes.
pub static TRAINED: LazyLock<Network> = LazyLock::new(|| {
    let numbers = include_str!("success_prior/weights.txt").split_whitespace();
    let mut numbers = numbers.map(|number| number.parse().expect("the weights are numbers"));
    Network {
        means: next(&mut numbers),
        scales: next(&mut numbers),
        biases: next(&mut numbers),
        outputs: next(&mut numbers),
        weights: std::array::from_fn(|_| next(&mut numbers)),
        output_bias: next::<1>(&mut numbers)[0],
    }
});

fn next<const N: usize>(numbers: &mut impl Iterator<Item = f32>) -> [f32; N] {
    std::array::from_fn(|_| numbers.next().expect("there are as many weights"))
}

impl Network {
    /// Log odds that the hand holds.
    pub fn log_odds(&self, inputs: &[f32; INPUTS]) -> f32 {
        let mut units = self.biases;
        for (i, weights) in self.weights.iter().enumerate() {
            let deviation = (inputs[i] - self.means[i]) * self.scales[i];
            let scaled = deviation.clamp(-MAX_DEVIATION, MAX_DEVIATION);
            // Indexed, because the compiler does not inline zipped and mapped arrays here.
            for k in 0..UNITS {
                units[k] += scaled * weights[k];
            }
        }
        let weighted = units.iter().zip(&self.outputs);
        self.output_bias + weighted.map(|(unit, weight)| unit.max(0.0) * weight).sum::<f32>()
    }
}

/// The features of an object from which the network's inputs are computed, in the object's frame.
#[derive(Clone, Copy, Debug)]
pub struct ObjectFeatures {
    centre_of_mass: Vec3,
    long_axis: Vec3,
    /// Logarithms of its box's half extents in metres, longest first.
    log_sizes: [f32; 3],
    /// Half the diagonal of its box, in metres.
    characteristic_length: f32,
}

impl ObjectFeatures {
    /// Computes the features of an object.
    pub fn of(object: &GraspObject) -> Self {
        let bounds = &object.bounding_box;
        let mut axes = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| (bounds.half_extents.dot(axis), axis));
        axes.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        Self {
            centre_of_mass: object.centre_of_mass,
            long_axis: bounds.object_from_box.transform_vector(axes[0].1),
            log_sizes: axes.map(|(half, _)| half.max(MIN_SIZE).ln()),
            characteristic_length: bounds.half_extents.length().max(MIN_SIZE),
        }
    }

    /// The network's inputs for a hand with this opposition at `object_from_wrist`, near other hands if there are any.
    pub fn inputs(
        &self,
        rig: &Rig,
        opposition: &Opposition,
        object_from_wrist: Pose,
        barriers: Barriers<'_>,
    ) -> [f32; INPUTS] {
        let wrist_from_object = object_from_wrist.inverse();
        let mut centre_of_mass = wrist_from_object.transform_point(self.centre_of_mass);
        let long_axis = wrist_from_object.transform_vector(self.long_axis).abs();
        // Distance of the centre of mass from the line through the pads, and along it from their midpoint.
        let across = (opposition.fingers - opposition.thumb).normalize_or_zero();
        let arm = centre_of_mass - (opposition.fingers + opposition.thumb) * 0.5;
        let along = arm.dot(across);
        let sideways = (arm - across * along).length();
        // The network was trained on right hands.
        if rig.handedness == Handedness::Left {
            centre_of_mass.x = -centre_of_mass.x;
        }
        let [from_thumb, from_fingers, from_palm] =
            [opposition.thumb, opposition.fingers, rig.palm].map(|point| {
                let point = object_from_wrist.transform_point(point);
                barriers
                    .hand_distance_upper_bound(point)
                    .map_or(MAX_GIVER_DISTANCE, |distance| {
                        distance.clamp(0.0, MAX_GIVER_DISTANCE)
                    })
            });
        let shape = &opposition.shape;
        let digits = shape.closing.iter().filter(|&&closes| closes).count();
        [
            opposition.width().max(MIN_SIZE).ln(),
            sideways / self.characteristic_length,
            along.abs(),
            centre_of_mass.x,
            centre_of_mass.y,
            centre_of_mass.z,
            long_axis.x,
            long_axis.y,
            long_axis.z,
            self.log_sizes[0],
            self.log_sizes[1],
            self.log_sizes[2],
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
