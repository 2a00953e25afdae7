//! Options for requirements on the grasp.

use clap::Args;
use glam::Vec3;
use grasp_client::{Digit, GraspType, v1};

use crate::values::{DIGITS, grasp_type, one_of, parse_cone};

/// Requirements on the grasp beyond validity.
#[derive(Args, Debug)]
#[command(next_help_heading = "Requirements on the grasp")]
pub(super) struct RequirementOptions {
    /// Direction in which the hand moves toward the object, and the largest deviation in degrees.
    #[arg(long, value_name = "X,Y,Z,DEGREES", value_parser = parse_cone, allow_hyphen_values = true)]
    approach: Option<(Vec3, f32)>,
    /// Only grasps of this type of the taxonomy; may be repeated.
    #[arg(long, value_name = "NAME", value_parser = grasp_type(), value_delimiter = ',', ignore_case = true)]
    grasp_type: Vec<GraspType>,
    /// No grasps of this type, named as for --grasp-type; may be repeated.
    #[arg(long, value_name = "NAME", value_parser = grasp_type(), value_delimiter = ',', ignore_case = true)]
    #[arg(hide_possible_values = true)]
    not_grasp_type: Vec<GraspType>,
    /// Digits that must touch the object, such as thumb,index.
    #[arg(long, value_name = "DIGITS", value_parser = one_of(DIGITS), value_delimiter = ',')]
    must_touch: Vec<Digit>,
    /// Digits that must not touch the object.
    #[arg(long, value_name = "DIGITS", value_parser = one_of(DIGITS), value_delimiter = ',')]
    must_not_touch: Vec<Digit>,
    /// Largest comfort E; 0 is best.
    #[arg(long, value_name = "E")]
    max_comfort: Option<f32>,
}

impl RequirementOptions {
    /// Overrides requirements of the request with the options that are given.
    pub(super) fn override_in(&self, requirements: &mut v1::Requirements) {
        if let Some((direction, degrees)) = self.approach {
            requirements.client_approach = Some(direction.into());
            requirements.max_approach_angle = degrees.to_radians();
        }
        replace(&mut requirements.allowed_grasp_types, &self.grasp_type);
        replace(&mut requirements.excluded_grasp_types, &self.not_grasp_type);
        replace(&mut requirements.must_touch, &self.must_touch);
        replace(&mut requirements.must_not_touch, &self.must_not_touch);
        if self.max_comfort.is_some() {
            requirements.thesis.get_or_insert_default().max_comfort = self.max_comfort;
        }
    }
}

/// Replaces values of an enumeration by those that are given, if any are.
fn replace<T: Copy + Into<i32>>(values: &mut Vec<i32>, given: &[T]) {
    if !given.is_empty() {
        *values = given.iter().map(|&value| value.into()).collect();
    }
}
