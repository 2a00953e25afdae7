//! Options for what an object is, which new objects and changed ones share.

use std::path::PathBuf;

use clap::Args;
use glam::Vec3;
use grasp_client::v1;

use super::marks::forbidden;
use crate::{
    Failure,
    input::read_messages,
    values::{full_name, parse_label, parse_vector},
};

/// What an object is.
#[derive(Args, Debug)]
pub(super) struct Properties {
    /// Centre of mass in metres after scaling and turning. Default of new objects: that of the mesh's volume.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    pub(super) centre_of_mass: Option<Vec3>,
    /// Coefficient of static friction between skin and surface. Default of new objects: the server's.
    #[arg(long, value_name = "MU")]
    pub(super) friction: Option<f32>,
    /// A group, object or material of the file that must not be touched; may be repeated. An update replaces all regions.
    #[arg(long, value_name = "NAME")]
    pub(super) forbidden_group: Vec<String>,
    /// A JSON file with the object's regions, which hands should take, leave, or not touch; see `grasp objects create --help`. An
    /// update replaces all regions, with the forbidden surfaces.
    #[arg(long, value_name = "FILE")]
    pub(super) regions: Option<PathBuf>,
    /// A JSON file with grips of the object, to try first or not to answer; see `grasp objects create --help`. An update replaces
    /// all known grips.
    #[arg(long, value_name = "FILE")]
    pub(super) known_grips: Option<PathBuf>,
    /// A label, such as level=kitchen; may be repeated. An update replaces all labels.
    #[arg(long = "label", value_name = "KEY=VALUE", value_parser = parse_label)]
    pub(super) labels: Vec<(String, String)>,
}

impl Properties {
    /// An object of this name with these properties; the forbidden surfaces are the last of its regions.
    pub(super) fn object(self, name: &str) -> Result<v1::GraspObject, Failure> {
        let regions = self.regions.map(|path| read_messages("regions", &path));
        let known_grips = self.known_grips.map(|path| read_messages("known grips", &path));
        let mut regions = regions.transpose()?.unwrap_or_default();
        regions.extend(forbidden(self.forbidden_group));
        Ok(v1::GraspObject {
            name: full_name("objects", name),
            labels: self.labels.into_iter().collect(),
            center_of_mass: self.centre_of_mass.map(Into::into),
            friction: self.friction,
            regions,
            known_grips: known_grips.transpose()?.unwrap_or_default(),
            ..v1::GraspObject::default()
        })
    }
}
