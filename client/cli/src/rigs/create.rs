//! `grasp rigs create`

use std::path::PathBuf;

use clap::Args;
use grasp_client::{NewRig, RigNode};

use crate::{
    failure::Failure, objects::id_from_file, output::Output, server_options::ServerOptions, values::HandName,
};

/// Create a rig from a GLB, glTF or VRM file with a skinned hand or a whole character.
///
/// Shows the new rig, like `grasp rigs get`.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// Last part of the rig's name. Default: the file's name in lower case, with hyphens.
    id: Option<String>,
    /// The model.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// The hand that the model shows, if the names of its nodes do not say.
    #[arg(long, value_name = "HAND")]
    hand: Option<HandName>,
    /// A node and the joint that it is, such as Bone.012=index-finger-phalanx-proximal, for names that are not known; may be
    /// repeated. Joints have the names of the web's hand input module.
    #[arg(long, value_name = "NODE=JOINT", value_parser = parse_joint)]
    joint: Vec<(String, String)>,
    #[command(flatten)]
    server: ServerOptions,
}

pub(super) async fn run(arguments: Arguments, output: Output) -> Result<(), Failure> {
    let model = std::fs::read(&arguments.model)
        .map_err(|error| Failure::other(format!("cannot read {}", arguments.model.display()), error))?;
    let id = arguments.id.unwrap_or_else(|| id_from_file(&arguments.model));
    let joints = arguments.joint.into_iter();
    let rig = NewRig {
        joint_map: joints
            .map(|(node, joint)| RigNode {
                node,
                joint,
                handedness: None,
            })
            .collect(),
        handedness: arguments.hand.and_then(Into::into),
        ..NewRig::of_model(id, model)
    };
    let rig = arguments.server.connect().await?.create_rig(&rig).await?;
    output.write_message("Rig", &rig, super::describe)
}

/// The node and the joint of NODE=JOINT; names of nodes may contain the sign.
fn parse_joint(text: &str) -> Result<(String, String), String> {
    text.rsplit_once('=')
        .filter(|(node, joint)| !node.is_empty() && !joint.is_empty())
        .map(|(node, joint)| (node.to_owned(), joint.to_owned()))
        .ok_or_else(|| "must be NODE=JOINT".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_follows_the_last_sign() {
        let pair = |node: &str, joint: &str| Ok((node.to_owned(), joint.to_owned()));
        assert_eq!(parse_joint("Bone.1=wrist"), pair("Bone.1", "wrist"));
        assert_eq!(parse_joint("a=b=wrist"), pair("a=b", "wrist"));
        assert!(parse_joint("wrist").is_err() && parse_joint("=wrist").is_err());
    }
}
