//! `grasp objects get`

use clap::Args;

use crate::{Ending, failure::Failure, output::Output, server_options::ServerOptions};

const ABOUT: &str = r"Show everything about an object except its mesh.

With --json: name, built_in, triangle_count, vertex_count, mass_kg, centre_of_mass, friction, forbidden_triangle_count,
object_from_box, box_half_extents, content_hash, warnings, atlas and left_atlas (null, or entries, complete, stamp,
build_time_seconds, learned, growth: waiting, growing, complete, nothing_found, at_rest, no_memory or failed), origin_in_file (null, or
x y z in the units of the mesh file), regions and known_grips (as `objects create` reads them), labels, etag, create_time, update_time
(RFC 3339); metres, kilograms, quaternions x y z w.";

/// Show everything about an object except its mesh.
#[derive(Args, Debug)]
#[command(long_about = ABOUT)]
pub(crate) struct Arguments {
    /// The object's name: "remote" or "objects/remote".
    name: String,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<Ending, Failure> {
    let client = arguments.server.connect().await?;
    let object = client.get_object(super::full_name(&arguments.name)).await?;
    output.write(&object, super::describe)?;
    Ok(Ending::Done)
}
