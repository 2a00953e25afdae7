//! `grasp objects update`

use clap::Args;
use grasp_client::{GraspClient, Preference, v1};

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
    /// Allow touching every surface.
    #[arg(long, conflicts_with_all = ["forbidden_group", "forbidden_triangles"])]
    nothing_forbidden: bool,
    /// Remove all regions, with the forbidden surfaces.
    #[arg(long, conflicts_with = "regions")]
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
    let keeps_regions = fields.contains(&"regions") && !arguments.replaces_regions();
    let mut change = v1::GraspObject {
        etag: arguments.etag.unwrap_or_default(),
        mass_kg: arguments.mass.unwrap_or_default(),
        meters_per_unit: arguments.unit_metres,
        ..arguments.properties.object(&arguments.name)?
    };
    let client = arguments.server.connect().await?;
    if keeps_regions {
        keep_regions(&client, &mut change).await?;
    }
    let update = v1::UpdateObjectRequest::new(change, fields);
    let object = client.update_object(&update).await?;
    show(&client, &object, output).await
}

impl Arguments {
    /// The fields to change.
    fn fields(&self) -> Vec<&'static str> {
        let given = &self.properties;
        let has_centre = given.centre_of_mass.is_some() || self.default_centre_of_mass;
        let has_forbidden = given.forbids() || self.nothing_forbidden;
        let fields = [
            ("meters_per_unit", self.unit_metres.is_some()),
            ("mass_kg", self.mass.is_some()),
            ("center_of_mass", has_centre),
            ("friction", given.friction.is_some() || self.default_friction),
            ("regions", self.replaces_regions() || has_forbidden),
            ("known_grips", given.known_grips.is_some() || self.no_known_grips),
            ("labels", !given.labels.is_empty() || self.no_labels),
        ];
        let fields = fields.into_iter().filter(|(_, is_given)| *is_given);
        fields.map(|(field, _)| field).collect()
    }

    fn replaces_regions(&self) -> bool {
        self.properties.regions.is_some() || self.no_regions
    }
}

/// Keeps the regions that may be touched, as only forbidden surfaces change.
async fn keep_regions(client: &GraspClient, change: &mut v1::GraspObject) -> Result<(), Failure> {
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
