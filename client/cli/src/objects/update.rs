//! `grasp objects update`

use clap::Args;
use grasp_client::v1;

use super::{describe::show, properties::Properties};
use crate::{Failure, Output, ServerOptions};

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
    #[command(flatten)]
    properties: Properties,
    /// Compute the centre of mass from the mesh.
    #[arg(long, conflicts_with = "centre_of_mass")]
    default_centre_of_mass: bool,
    /// Use the server's coefficient of friction.
    #[arg(long, conflicts_with = "friction")]
    default_friction: bool,
    /// Remove all regions, with the forbidden surfaces.
    #[arg(long, conflicts_with_all = ["regions", "forbidden_group"])]
    no_regions: bool,
    /// Remove all known grips.
    #[arg(long, conflicts_with = "known_grips")]
    no_known_grips: bool,
    /// Remove all labels.
    #[arg(long, conflicts_with = "labels")]
    no_labels: bool,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<(), Failure> {
    let fields = arguments.fields();
    if fields.is_empty() {
        return Err(Failure::usage(
            "nothing to change; give a unit, mass, centre of mass, friction, forbidden surfaces, regions, known grips or labels",
        ));
    }
    let change = v1::GraspObject {
        etag: arguments.etag.unwrap_or_default(),
        mass_kg: arguments.mass.unwrap_or_default(),
        meters_per_unit: arguments.unit_metres,
        ..arguments.properties.object(&arguments.name)?
    };
    let client = arguments.server.connect().await?;
    let update = v1::UpdateObjectRequest::new(change, fields);
    let object = client.update_object(&update).await?;
    show(&client, &object, output).await
}

impl Arguments {
    /// The fields to change.
    fn fields(&self) -> Vec<&'static str> {
        let given = &self.properties;
        let has_centre = given.centre_of_mass.is_some() || self.default_centre_of_mass;
        let has_regions = given.regions.is_some() || !given.forbidden_group.is_empty();
        let fields = [
            ("meters_per_unit", self.unit_metres.is_some()),
            ("mass_kg", self.mass.is_some()),
            ("center_of_mass", has_centre),
            ("friction", given.friction.is_some() || self.default_friction),
            ("regions", has_regions || self.no_regions),
            ("known_grips", given.known_grips.is_some() || self.no_known_grips),
            ("labels", !given.labels.is_empty() || self.no_labels),
        ];
        let fields = fields.into_iter().filter(|(_, is_given)| *is_given);
        fields.map(|(field, _)| field).collect()
    }
}
