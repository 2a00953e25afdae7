//! `grasp objects update`

use std::path::PathBuf;

use clap::Args;
use glam::Vec3;
use grasp_client::{ForbiddenSurfaces, ObjectUpdate, Reset};

use super::{known_grips_in, regions_in};
use crate::{
    Ending,
    failure::Failure,
    output::Output,
    server_options::ServerOptions,
    values::{TriangleRange, parse_label, parse_triangles, parse_vector},
};

/// Change an object's labels or physical properties; its mesh stays.
///
/// Shows the changed object, like `grasp objects get`.
#[derive(Args, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
pub(crate) struct Arguments {
    /// The object's name: "mug" or "objects/mug".
    name: String,
    /// Change it only if it still has this etag.
    #[arg(long, value_name = "ETAG")]
    etag: Option<String>,
    /// Metres per unit of the mesh: gives the object another size. What was given in metres or kilograms stays as it is.
    #[arg(long, value_name = "METRES")]
    unit_metres: Option<f32>,
    /// Mass in kilograms.
    #[arg(long, value_name = "KG")]
    mass: Option<f32>,
    /// Centre of mass in metres.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    centre_of_mass: Option<Vec3>,
    /// Compute the centre of mass from the mesh.
    #[arg(long, conflicts_with = "centre_of_mass")]
    default_centre_of_mass: bool,
    /// Coefficient of static friction between skin and surface.
    #[arg(long, value_name = "MU")]
    friction: Option<f32>,
    /// Use the server's coefficient of friction.
    #[arg(long, conflicts_with = "friction")]
    default_friction: bool,
    /// A group, object or material of the file that must not be touched; may be repeated. Replaces all forbidden surfaces.
    #[arg(long, value_name = "NAME")]
    forbidden_group: Vec<String>,
    /// Triangles that must not be touched: indices and ranges, such as 7,10-20. Replaces all forbidden surfaces.
    #[arg(long, value_name = "INDICES", value_parser = parse_triangles, value_delimiter = ',')]
    forbidden_triangles: Vec<TriangleRange>,
    /// Allow touching every surface.
    #[arg(long, conflicts_with_all = ["forbidden_group", "forbidden_triangles"])]
    nothing_forbidden: bool,
    /// A JSON file with regions, as of `grasp objects create`. Replaces all regions.
    #[arg(long, value_name = "FILE")]
    regions: Option<PathBuf>,
    /// Remove all regions.
    #[arg(long, conflicts_with = "regions")]
    no_regions: bool,
    /// A JSON file with known grips, as of `grasp objects create`. Replaces all known grips.
    #[arg(long, value_name = "FILE")]
    known_grips: Option<PathBuf>,
    /// Remove all known grips.
    #[arg(long, conflicts_with = "known_grips")]
    no_known_grips: bool,
    /// A label, such as level=kitchen; may be repeated. Replaces all labels.
    #[arg(long = "label", value_name = "KEY=VALUE", value_parser = parse_label)]
    labels: Vec<(String, String)>,
    /// Remove all labels.
    #[arg(long, conflicts_with = "labels")]
    no_labels: bool,
    #[command(flatten)]
    server: ServerOptions,
}

impl Arguments {
    fn update(&self) -> Result<ObjectUpdate, Failure> {
        let triangles = self.forbidden_triangles.iter();
        let forbidden = ForbiddenSurfaces {
            groups: self.forbidden_group.clone(),
            triangles: triangles.flat_map(|range| range.0.clone()).collect(),
        };
        let is_forbidden_given = self.nothing_forbidden || forbidden != ForbiddenSurfaces::default();
        let are_labels_given = self.no_labels || !self.labels.is_empty();
        let regions = regions_in(self.regions.as_deref())?;
        let known_grips = known_grips_in(self.known_grips.as_deref())?;
        Ok(ObjectUpdate {
            etag: self.etag.clone(),
            unit_metres: self.unit_metres,
            mass_kg: self.mass,
            centre_of_mass: reset(self.centre_of_mass, self.default_centre_of_mass),
            friction: reset(self.friction, self.default_friction),
            forbidden: is_forbidden_given.then_some(forbidden),
            regions: regions.or(self.no_regions.then(Vec::new)),
            known_grips: known_grips.or(self.no_known_grips.then(Vec::new)),
            labels: are_labels_given.then(|| self.labels.iter().cloned().collect()),
        })
    }
}

fn reset<T>(value: Option<T>, to_default: bool) -> Option<Reset<T>> {
    value.map(Reset::To).or(to_default.then_some(Reset::Default))
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let update = arguments.update()?;
    if update.is_empty() {
        return Err(Failure::Usage(
            "nothing to change; give a unit, mass, centre of mass, friction, forbidden surfaces, regions, known grips or labels"
                .to_owned(),
        ));
    }
    let client = arguments.server.connect().await?;
    let object = client
        .update_object(super::full_name(&arguments.name), &update)
        .await?;
    output.write_message("Object", &object, super::describe)?;
    Ok(Ending::Done)
}
