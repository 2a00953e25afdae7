//! `grasp objects grips`

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use grasp_client::{
    Convention, CurrentGraspStatus, GraspClient, Preference,
    v1::{self, CurrentGrasp, FindGraspRequest, KnownGrip, UpdateObjectRequest, ValidateGraspRequest},
};
use serde_json::json;

use super::describe::show;
use crate::{
    Failure, Output,
    input::full_name,
    isaac::{self, Gripper, NamedGrasp},
    output::{list, pairs, table},
};

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Write the preferred grips of one hand to a file in the format `isaac_grasp` 1.0.
    ///
    /// A grip's confidence is its score without a giver; 0 if it is not valid.
    ///
    /// With --json: {"file": PATH, "grips": [{"name", "confidence"}], "omitted": […]} with the names of grips left out.
    #[command(after_long_help = isaac::ABOUT)]
    Export(Arguments),
    /// Add the grasps of a file in the format `isaac_grasp` 1.0 to the preferred grips of an object.
    ///
    /// They are tried in the file's order. A grip that the object has by the same name is replaced.
    ///
    /// Shows the changed object, like `grasp objects get`.
    #[command(after_long_help = isaac::ABOUT)]
    Import(Arguments),
}

#[derive(Args, Debug)]
pub(super) struct Arguments {
    /// The object's name: "mug" or "objects/mug".
    name: String,
    /// The file.
    #[arg(long, value_name = "FILE")]
    isaac: PathBuf,
    /// The hand: rigs/adult/right, or rigs/adult/right/1.1 for one 1.1 times as large as its rig. Default: the only one that
    /// the object has grips of, or that the file names.
    #[arg(long, value_name = "HAND")]
    gripper: Option<Gripper>,
}

pub(super) async fn run(client: &GraspClient, command: Command, output: Output) -> Result<(), Failure> {
    match command {
        Command::Export(arguments) => export(client, arguments, output).await,
        Command::Import(arguments) => import(client, arguments, output).await,
    }
}

async fn export(client: &GraspClient, arguments: Arguments, output: Output) -> Result<(), Failure> {
    let object = client.get_object(full_name("objects", &arguments.name)).await?;
    let is_exported = |grip: &&KnownGrip| {
        let of = grip.hand.as_ref().map(Gripper::of);
        let is_of = arguments.gripper.is_none() || arguments.gripper == of;
        grip.preference() == Preference::Preferred && is_of
    };
    let (exported, left_out): (Vec<_>, Vec<_>) = object.known_grips.iter().partition(is_exported);
    if exported.is_empty() {
        let gripper = arguments
            .gripper
            .map(|gripper| format!(" of {gripper}"))
            .unwrap_or_default();
        return Err(Failure::usage(format!(
            "{} has no preferred grips{gripper}",
            object.name
        )));
    }
    let mut grasps = Vec::new();
    for grip in exported {
        grasps.push(rated(client, &object.name, grip).await?);
    }
    isaac::write(&arguments.isaac, &object, &grasps)?;
    let left_out: Vec<&str> = left_out.iter().map(|grip| grip.name.as_str()).collect();
    let grips = grasps
        .iter()
        .map(|grasp| json!({ "name": grasp.name, "confidence": grasp.confidence }));
    let grips: Vec<_> = grips.collect();
    let answer = json!({ "file": arguments.isaac, "grips": grips, "omitted": left_out });
    output.write(&answer, |_| written(&arguments.isaac, &grasps, &left_out))
}

fn written(file: &Path, grasps: &[NamedGrasp], left_out: &[&str]) -> String {
    let mut table = table("grip | >confidence");
    for grasp in grasps {
        table.add_row([grasp.name.clone(), format!("{:.3}", grasp.confidence)]);
    }
    let mut lines = vec![("file", file.display().to_string())];
    if !left_out.is_empty() {
        lines.push(("omitted", list(left_out)));
    }
    format!("{table}\n\n{}", pairs(&lines))
}

/// A grip with its score and its open hand, if it is valid and nobody holds the object.
async fn rated(client: &GraspClient, object: &str, grip: &KnownGrip) -> Result<NamedGrasp, Failure> {
    let hand = grip.hand.clone().unwrap_or_default();
    let receiver = Gripper::of(&hand).receiver();
    let mut request = FindGraspRequest::new(object).with_key_frames();
    request.receiver = Some(receiver.clone());
    request.current = Some(CurrentGrasp {
        committed: true,
        ..CurrentGrasp::new(hand.clone())
    });
    let answer = client.find_grasp(&request).await?;
    let kept = answer
        .grasp()
        .filter(|_| answer.status() == CurrentGraspStatus::Kept);
    let mut grasp = NamedGrasp::found(&grip.name, kept.unwrap_or(&v1::Grasp::default()));
    grasp.hand = if matches!(hand.convention(), Convention::Unspecified | Convention::Openxr) {
        hand
    } else {
        // The answer is in OpenXR's axes.
        let mut request = ValidateGraspRequest::new(object).with_pose(hand);
        request.receiver = Some(receiver);
        let validated = client.validate_grasp(&request).await?.grasp;
        validated.and_then(|grasp| grasp.hand).unwrap_or_default()
    };
    Ok(grasp)
}

async fn import(client: &GraspClient, arguments: Arguments, output: Output) -> Result<(), Failure> {
    let mut object = client.get_object(full_name("objects", &arguments.name)).await?;
    for (name, hand) in isaac::read(&arguments.isaac, &object, arguments.gripper.as_ref())? {
        let grip = KnownGrip::new(name, Preference::Preferred, hand);
        match object
            .known_grips
            .iter_mut()
            .find(|known| known.name == grip.name)
        {
            Some(known) => *known = grip,
            None => object.known_grips.push(grip),
        }
    }
    // Its etag is that of the state that was read.
    let update = UpdateObjectRequest::new(object, ["known_grips"]);
    let object = client.update_object(&update).await?;
    show(client, &object, output).await
}
