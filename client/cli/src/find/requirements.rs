//! Options for requirements on the grasp.

use clap::Args;
use grasp_client::{Digit, v1};

use crate::values::{Cone, DigitName, GraspTypeName, parse_cone};

/// Requirements on the grasp beyond validity.
#[derive(Args, Debug)]
#[command(next_help_heading = "Requirements on the grasp")]
pub(super) struct RequirementOptions {
    /// Direction in which the hand moves toward the object, and the largest deviation in degrees.
    #[arg(long, value_name = "X,Y,Z,DEGREES", value_parser = parse_cone, allow_hyphen_values = true)]
    approach: Option<Cone>,
    /// Only grasps of this type of the taxonomy; may be repeated.
    #[arg(long, value_name = "NAME", value_delimiter = ',', ignore_case = true)]
    grasp_type: Vec<GraspTypeName>,
    /// No grasps of this type, named as for --grasp-type; may be repeated.
    #[arg(
        long,
        value_name = "NAME",
        value_delimiter = ',',
        ignore_case = true,
        hide_possible_values = true
    )]
    not_grasp_type: Vec<GraspTypeName>,
    /// Digits that must touch the object, such as thumb,index.
    #[arg(long, value_name = "DIGITS", value_delimiter = ',')]
    must_touch: Vec<DigitName>,
    /// Digits that must not touch the object.
    #[arg(long, value_name = "DIGITS", value_delimiter = ',')]
    must_not_touch: Vec<DigitName>,
    /// Largest comfort E; 0 is best.
    #[arg(long, value_name = "E")]
    max_comfort_e: Option<f32>,
}

impl RequirementOptions {
    /// Overrides requirements of the request with the options that are given.
    pub(super) fn override_in(&self, requirements: &mut v1::Requirements) {
        if let Some(cone) = self.approach {
            requirements.client_approach = Some(cone.direction.into());
            requirements.max_approach_angle = cone.half_angle_degrees.to_radians();
        }
        let types = |names: &[GraspTypeName]| names.iter().map(|name| name.0.into()).collect();
        if !self.grasp_type.is_empty() {
            requirements.allowed_grasp_types = types(&self.grasp_type);
        }
        if !self.not_grasp_type.is_empty() {
            requirements.excluded_grasp_types = types(&self.not_grasp_type);
        }
        let digits = |names: &[DigitName]| names.iter().map(|&name| Digit::from(name).into()).collect();
        if !self.must_touch.is_empty() {
            requirements.must_touch = digits(&self.must_touch);
        }
        if !self.must_not_touch.is_empty() {
            requirements.must_not_touch = digits(&self.must_not_touch);
        }
        if self.max_comfort_e.is_some() {
            requirements.thesis.get_or_insert_default().max_comfort = self.max_comfort_e;
        }
    }
}
