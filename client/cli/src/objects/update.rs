//! `grasp objects update`

use std::{ops::RangeInclusive, path::PathBuf};

use clap::Args;
use glam::Vec3;
use grasp_client::{GraspClient, Preference, v1};

use super::{full_name, known_grips_in, regions, regions_in};
use crate::{
    Ending,
    failure::Failure,
    output::Output,
    server_options::ServerOptions,
    values::{parse_label, parse_triangles, parse_vector},
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
    forbidden_triangles: Vec<RangeInclusive<u32>>,
    /// Allow touching every surface.
    #[arg(long, conflicts_with_all = ["forbidden_group", "forbidden_triangles"])]
    nothing_forbidden: bool,
    /// A JSON file with regions, as of `grasp objects create`. Replaces all regions, with the forbidden surfaces.
    #[arg(long, value_name = "FILE")]
    regions: Option<PathBuf>,
    /// Remove all regions, with the forbidden surfaces.
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
    /// The fields to change. Of a change of forbidden surfaces alone, the regions are still to come.
    fn update(&self) -> Result<v1::UpdateObjectRequest, Failure> {
        let mut regions = regions_in(self.regions.as_deref())?.unwrap_or_default();
        regions.extend(self.forbidden());
        let fields = [
            ("meters_per_unit", self.unit_metres.is_some()),
            ("mass_kg", self.mass.is_some()),
            (
                "center_of_mass",
                self.centre_of_mass.is_some() || self.default_centre_of_mass,
            ),
            ("friction", self.friction.is_some() || self.default_friction),
            (
                "regions",
                self.replaces_regions() || self.nothing_forbidden || !regions.is_empty(),
            ),
            ("known_grips", self.known_grips.is_some() || self.no_known_grips),
            ("labels", self.no_labels || !self.labels.is_empty()),
        ];
        let object = v1::GraspObject {
            name: full_name(&self.name),
            etag: self.etag.clone().unwrap_or_default(),
            labels: self.labels.iter().cloned().collect(),
            mass_kg: self.mass.unwrap_or_default(),
            center_of_mass: self.centre_of_mass.map(Into::into),
            friction: self.friction,
            regions,
            known_grips: known_grips_in(self.known_grips.as_deref())?.unwrap_or_default(),
            meters_per_unit: self.unit_metres,
            ..v1::GraspObject::default()
        };
        let given = fields.into_iter().filter(|(_, is_given)| *is_given);
        let update = v1::UpdateObjectRequest::new(object, given.map(|(field, _)| field));
        if update
            .update_mask
            .as_ref()
            .is_none_or(|mask| mask.paths.is_empty())
        {
            return Err(Failure::Usage(
                "nothing to change; give a unit, mass, centre of mass, friction, forbidden surfaces, regions, known grips or labels"
                    .to_owned(),
            ));
        }
        Ok(update)
    }

    fn forbidden(&self) -> Option<v1::Region> {
        regions::forbidden(self.forbidden_group.clone(), &self.forbidden_triangles)
    }

    fn replaces_regions(&self) -> bool {
        self.regions.is_some() || self.no_regions
    }

    /// Keeps the regions that may be touched if only forbidden surfaces change.
    async fn keep_regions(&self, client: &GraspClient, change: &mut v1::GraspObject) -> Result<(), Failure> {
        let is_forbidden_given = self.nothing_forbidden || self.forbidden().is_some();
        if self.replaces_regions() || !is_forbidden_given {
            return Ok(());
        }
        let present = client.get_object(&change.name).await?;
        let mut kept = present.regions;
        kept.retain(|region| region.preference() != Preference::Forbidden);
        kept.append(&mut change.regions);
        change.regions = kept;
        if change.etag.is_empty() {
            change.etag = present.etag;
        }
        Ok(())
    }
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let mut update = arguments.update()?;
    let client = arguments.server.connect().await?;
    if let Some(change) = &mut update.object {
        arguments.keep_regions(&client, change).await?;
    }
    let object = client.update_object(&update).await?;
    super::show(&client, &object, output).await
}
