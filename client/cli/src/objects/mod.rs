//! `grasp objects`

mod describe;
mod grips;

use std::path::{Path, PathBuf};

use clap::{ArgAction, Args, Subcommand};
use glam::Vec3;
use grasp_client::{
    ClientError, Code, GraspClient, Preference,
    v1::{
        self, Atlas, Handedness, ListObjectsRequest, ListObjectsResponse, ObjectChange, ObjectView,
        WatchObjectsResponse,
    },
};
use serde_json::json;

use crate::{
    Failure, Output, ServerOptions,
    input::{Choice, full_name, id_from_file, one_of, parse_label, parse_vector, read_file, read_messages},
    output::{
        joined, list as listed, message_json, name_of, pairs, table, write_file, write_line, write_message,
        write_message_line, yes_or_no,
    },
};
use describe::{KNOWN_GRIPS, REGIONS, atlas_state, friction, labels, show, size};

/// List, show, create, change, delete and watch objects, save their meshes, show their atlases, and exchange their grips.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    server: ServerOptions,
}

#[derive(Debug, Subcommand)]
enum Command {
    List(ListArguments),
    /// Show everything about an object except its mesh.
    ///
    /// With --json: the API's `GraspObject` in protobuf's JSON.
    Get {
        /// The object's name: "remote" or "objects/remote".
        name: String,
    },
    Create(CreateArguments),
    Update(UpdateArguments),
    /// Delete an object. Running searches finish.
    ///
    /// With --json: {"deleted": NAME}.
    Delete {
        /// The object's name: "mug" or "objects/mug".
        name: String,
        /// Delete it only if it still has this etag.
        #[arg(long, value_name = "ETAG")]
        etag: Option<String>,
    },
    Watch(WatchArguments),
    /// Save an object's mesh, as searches use it, as a GLB file.
    ///
    /// In metres and +Y up. Triangles that must not be touched have the material "forbidden".
    ///
    /// With --json: {"file": PATH, "bytes": N, "object": …} with the object as in `grasp objects get --json`.
    Mesh {
        /// The file to write.
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        /// The object's name: "remote" or "objects/remote".
        name: String,
    },
    /// Show the state of an object's atlases, the grasps known in advance for either hand.
    ///
    /// With --json: {"atlases": […]}, each the API's Atlas in protobuf's JSON.
    Atlas {
        /// The object's name: "remote" or "objects/remote".
        name: String,
    },
    /// Export an object's preferred grips to a file in the format `isaac_grasp` 1.0, or import them.
    #[command(subcommand)]
    Grips(grips::Command),
}

pub(crate) async fn run(Arguments { command, server }: Arguments, output: Output) -> Result<(), Failure> {
    match command {
        Command::List(arguments) => list(&server.connect().await?, arguments, output).await,
        Command::Get { name } => {
            let client = server.connect().await?;
            let object = client.get_object(full_name("objects", &name)).await?;
            show(&client, &object, output).await
        }
        Command::Create(arguments) => create(arguments, &server, output).await,
        Command::Update(arguments) => update(arguments, &server, output).await,
        Command::Delete { name, etag } => {
            let name = full_name("objects", &name);
            server.connect().await?.delete_object(&name, etag).await?;
            output.write(&json!({ "deleted": name }), |_| format!("deleted {name}"))
        }
        Command::Watch(arguments) => watch(&server.connect().await?, arguments, output).await,
        Command::Mesh { out, name } => mesh(&server.connect().await?, &out, &name, output).await,
        Command::Grips(command) => grips::run(&server.connect().await?, command, output).await,
        Command::Atlas { name } => atlases(&server.connect().await?, &name, output).await,
    }
}

async fn atlases(client: &GraspClient, name: &str, output: Output) -> Result<(), Failure> {
    let name = full_name("objects", name);
    let mut table = table("hand | state | stamp | stamp of the learned");
    let mut written = Vec::new();
    for hand in ["left", "right"] {
        let atlas = client.get_atlas(format!("{name}/atlases/{hand}")).await?;
        written.push(message_json(&atlas)?);
        let (hand, state) = (name_of(atlas.handedness()), atlas_state(&atlas));
        table.add_row([hand, state, atlas.stamp, atlas.learned_stamp]);
    }
    output.write(&json!({ "atlases": written }), |_| table.to_string())
}

/// The state of an object's atlas for the "left" or "right" hand; an empty one if the object is gone.
pub(crate) async fn atlas_of(client: &GraspClient, object: &str, hand: &str) -> Result<Atlas, ClientError> {
    match client.get_atlas(format!("{object}/atlases/{hand}")).await {
        Err(error) if error.code() == Some(Code::NotFound) => Ok(Atlas::default()),
        atlas => atlas,
    }
}

/// List the objects of the server, all or some.
///
/// With --json: {"objects": […]}, each like the output of `grasp objects get --json`.
#[derive(Args, Debug)]
struct ListArguments {
    /// Which objects, by labels or the start of the name: `labels.level = "kitchen" AND name = "objects/mug*"`.
    #[arg(long, value_name = "FILTER", default_value = "", hide_default_value = true)]
    filter: String,
    /// `name` or `create_time`, optionally followed by desc [default: name].
    #[arg(long, value_name = "FIELD", default_value = "", hide_default_value = true)]
    order_by: String,
}

async fn list(client: &GraspClient, arguments: ListArguments, output: Output) -> Result<(), Failure> {
    let view = [ObjectView::Basic, ObjectView::Full][usize::from(output.json)];
    let request = ListObjectsRequest {
        filter: arguments.filter,
        order_by: arguments.order_by,
        view: view.into(),
        ..ListObjectsRequest::default()
    };
    let objects = client.list_objects(&request).await?;
    if output.json {
        return write_message(&ListObjectsResponse {
            objects,
            ..ListObjectsResponse::default()
        });
    }
    let mut table = table(
        "object | >triangles | >mass | >friction | box | >forbidden | built in | labels | >atlas | warnings",
    );
    for object in &objects {
        table.add_row([
            object.name.clone(),
            object.triangle_count.to_string(),
            format!("{:.0} g", object.mass_kg * 1000.0),
            friction(object),
            size(object),
            object.forbidden_triangle_count.to_string(),
            yes_or_no(object.built_in),
            labels(&object.labels),
            atlas_state(&atlas_of(client, &object.name, "right").await?),
            object.warnings.len().to_string(),
        ]);
    }
    write_line(&table.to_string())
}

/// Properties of an object.
#[derive(Args, Debug)]
struct Properties {
    /// Centre of mass in metres after scaling and turning. Default of new objects: the centroid of the mesh's volume.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    centre_of_mass: Option<Vec3>,
    /// Coefficient of static friction between skin and surface. Default of new objects: the server's.
    #[arg(long, value_name = "MU")]
    friction: Option<f32>,
    /// A group, object or material of the file that must not be touched; may be repeated. An update replaces all regions.
    #[arg(long, value_name = "NAME")]
    forbidden_group: Vec<String>,
    /// A JSON file with the object's regions, which hands should take, leave, or not touch; see `grasp objects create --help`. An
    /// update replaces all regions, with the forbidden surfaces.
    #[arg(long, value_name = "FILE")]
    regions: Option<PathBuf>,
    /// A JSON file with preferred or forbidden grips of the object; see `grasp objects create --help`. An update replaces all
    /// known grips.
    #[arg(long, value_name = "FILE")]
    known_grips: Option<PathBuf>,
    /// A label, such as level=kitchen; may be repeated. An update replaces all labels.
    #[arg(long = "label", value_name = "KEY=VALUE", value_parser = parse_label)]
    labels: Vec<(String, String)>,
}

impl Properties {
    /// An object of this name with these properties; forbidden surfaces are its last region.
    fn object(self, name: &str) -> Result<v1::GraspObject, Failure> {
        let regions = self.regions.map(|path| read_messages("regions", &path));
        let known_grips = self.known_grips.map(|path| read_messages("known grips", &path));
        let mut regions = regions.transpose()?.unwrap_or_default();
        if !self.forbidden_group.is_empty() {
            regions.push(v1::Region {
                groups: self.forbidden_group,
                ..v1::Region::new("forbidden", Preference::Forbidden)
            });
        }
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

/// Whether +Z points up.
const UP_AXES: [Choice<bool>; 2] = [
    ("y", false, "+Y"),
    ("z", true, "+Z, as in CAD and modelling tools"),
];

/// Create an object from a mesh: OBJ, STL, PLY, GLB or glTF.
///
/// Shows the new object, like `grasp objects get`.
#[derive(Args, Debug)]
#[command(after_long_help = format!("{}\n\n{}", REGIONS, KNOWN_GRIPS))]
struct CreateArguments {
    /// Last part of the object's name. Default: the file's name in lower case, with hyphens.
    id: Option<String>,
    /// The mesh.
    #[arg(long, value_name = "FILE", alias = "obj")]
    mesh: PathBuf,
    /// Mass in kilograms.
    #[arg(long, value_name = "KG")]
    mass: f32,
    /// Metres per unit of the mesh: 0.001 for millimetres. Default: 1.
    #[arg(long, value_name = "METRES")]
    unit_metres: Option<f32>,
    /// The axis that points up in the file.
    #[arg(long = "up-axis", value_name = "AXIS", value_parser = one_of(UP_AXES), default_value = "y")]
    #[arg(action = ArgAction::Set)]
    z_up: bool,
    /// A group, object or node of the file that belongs to the object; may be repeated. Default: all visible parts, without
    /// colliders and lower levels of detail.
    #[arg(long = "part", value_name = "NAME")]
    parts: Vec<String>,
    #[command(flatten)]
    properties: Properties,
}

async fn create(arguments: CreateArguments, server: &ServerOptions, output: Output) -> Result<(), Failure> {
    let mesh = read_file(&arguments.mesh)?;
    let id = arguments.id.unwrap_or_else(|| id_from_file(&arguments.mesh));
    let object = v1::GraspObject {
        mass_kg: arguments.mass,
        meters_per_unit: arguments.unit_metres,
        z_up: arguments.z_up,
        parts: arguments.parts,
        ..arguments.properties.object(&id)?
    };
    let request = v1::CreateObjectRequest {
        object: Some(object),
        mesh,
        request_id: String::new(),
    };
    let client = server.connect().await?;
    let object = client.create_object(&request).await?;
    show(&client, &object, output).await
}

/// Change an object's labels or physical properties; its mesh stays.
///
/// Shows the changed object, like `grasp objects get`.
#[derive(Args, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
struct UpdateArguments {
    /// The object's name: "mug" or "objects/mug".
    name: String,
    /// Change it only if it still has this etag.
    #[arg(long, value_name = "ETAG")]
    etag: Option<String>,
    /// Metres per unit of the mesh: changes the object's size. Properties in metres or kilograms stay as they are.
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
}

async fn update(arguments: UpdateArguments, server: &ServerOptions, output: Output) -> Result<(), Failure> {
    let fields = arguments.fields();
    if fields.is_empty() {
        let why = "nothing to change; give a unit, mass, centre of mass, friction, forbidden surfaces, regions, known grips or labels";
        return Err(Failure::usage(why));
    }
    let change = v1::GraspObject {
        etag: arguments.etag.unwrap_or_default(),
        mass_kg: arguments.mass.unwrap_or_default(),
        meters_per_unit: arguments.unit_metres,
        ..arguments.properties.object(&arguments.name)?
    };
    let client = server.connect().await?;
    let update = v1::UpdateObjectRequest::new(change, fields);
    let object = client.update_object(&update).await?;
    show(&client, &object, output).await
}

impl UpdateArguments {
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

/// Show changes of objects until interrupted or the server shuts down.
///
/// Changes of an object that come faster than they are read are merged, with its latest state.
///
/// With --json, one line per change: a `WatchObjectsResponse` in protobuf's JSON.
#[derive(Args, Debug)]
struct WatchArguments {
    /// Which objects, by labels or the start of the name: `labels.level = "kitchen" AND name = "objects/mug*"`.
    #[arg(long, value_name = "FILTER", default_value = "", hide_default_value = true)]
    filter: String,
    /// Show the present objects first.
    #[arg(long)]
    present: bool,
    /// End after this many changes.
    #[arg(long, value_name = "N")]
    count: Option<u64>,
}

async fn watch(client: &GraspClient, arguments: WatchArguments, output: Output) -> Result<(), Failure> {
    let mut watch = client.watch_objects(arguments.filter, arguments.present).await?;
    if !output.json {
        write_line(&line("change", "object", "mass", "atlas", "labels"))?;
    }
    let mut left = arguments.count;
    while left != Some(0)
        && let Some(news) = watch.next().await?
    {
        if output.json {
            write_message_line(&news)?;
        } else if !news.changes().any(|change| change == ObjectChange::PresentEnd) {
            write_line(&row(&news))?;
        }
        left = left.map(|left| left - 1);
    }
    Ok(())
}

fn row(news: &WatchObjectsResponse) -> String {
    let changes = listed(news.changes().map(name_of));
    let object = news.object.clone().unwrap_or_default();
    let last = news.changes().next_back();
    if matches!(last, Some(ObjectChange::Deleted | ObjectChange::Evicted)) {
        return line(&changes, &object.name, "", "", "");
    }
    let mass = format!("{:.0} g", object.mass_kg * 1000.0);
    let count = news.atlases.len();
    let atlases = joined("; ", news.atlases.iter().map(|atlas| of_hand(atlas, count)));
    let labels = labels(&object.labels);
    line(&changes, &object.name, &mass, &atlases, &labels)
}

/// The state of one atlas of several.
fn of_hand(atlas: &Atlas, count: usize) -> String {
    let state = atlas_state(atlas);
    match atlas.handedness() {
        Handedness::Right if count == 1 => state,
        hand => format!("{}: {state}", name_of(hand)),
    }
}

/// A row; its widths are fixed, as later rows are unknown.
fn line(changes: &str, name: &str, mass: &str, atlas: &str, labels: &str) -> String {
    let line = format!("{changes:22}  {name:28}  {mass:>7}  {atlas:18}  {labels}");
    line.trim_end().to_owned()
}

async fn mesh(client: &GraspClient, out: &Path, name: &str, output: Output) -> Result<(), Failure> {
    let name = full_name("objects", name);
    let mesh = client.get_mesh(&name).await?;
    let object = client.get_object(&name).await?;
    let bytes = mesh.glb.len();
    write_file(out, &mesh.glb)?;
    let answer = json!({ "file": out, "bytes": bytes, "object": message_json(&object)? });
    let (all, forbidden) = (object.triangle_count, object.forbidden_triangle_count);
    output.write(&answer, |_| {
        pairs(&[
            ("object", name),
            ("file", out.display().to_string()),
            ("size", format!("{bytes} bytes")),
            ("mesh", format!("{all} triangles, {forbidden} of them forbidden")),
        ])
    })
}
