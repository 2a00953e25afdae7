//! Options for constraints on the grasp.

use clap::Args;
use glam::Vec3;
use grasp_client::{ApproachCone, Constraints, Reach};

use crate::values::{Cone, DigitName, GraspTypeName, parse_cone, parse_vector};

/// Requirements on the grasp beyond validity.
#[derive(Args, Debug)]
#[command(next_help_heading = "Constraints on the grasp")]
pub(super) struct ConstraintOptions {
    /// Position of the receiver's shoulder; the wrist must be within --reach of it.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    #[arg(requires = "reach")]
    shoulder: Option<Vec3>,
    /// Largest distance from shoulder to wrist.
    #[arg(long, value_name = "METRES", requires = "shoulder")]
    reach: Option<f32>,
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

impl ConstraintOptions {
    /// Overrides constraints of the request with the options that are given.
    pub(super) fn override_in(&self, constraints: &mut Constraints) {
        if let (Some(client_shoulder), Some(reach)) = (self.shoulder, self.reach) {
            constraints.receiver_reach = Some(Reach {
                client_shoulder,
                reach,
            });
        }
        if let Some(cone) = self.approach {
            constraints.approach = Some(ApproachCone {
                client_direction: cone.direction,
                half_angle: cone.half_angle_degrees.to_radians(),
            });
        }
        let types = |names: &[GraspTypeName]| names.iter().map(|name| name.0).collect();
        if !self.grasp_type.is_empty() {
            constraints.allowed_grasp_types = types(&self.grasp_type);
        }
        if !self.not_grasp_type.is_empty() {
            constraints.excluded_grasp_types = types(&self.not_grasp_type);
        }
        let digits = |names: &[DigitName]| names.iter().map(|&name| name.into()).collect();
        if !self.must_touch.is_empty() {
            constraints.must_touch = digits(&self.must_touch);
        }
        if !self.must_not_touch.is_empty() {
            constraints.must_not_touch = digits(&self.must_not_touch);
        }
        constraints.max_comfort_e = self.max_comfort_e.or(constraints.max_comfort_e);
    }
}
