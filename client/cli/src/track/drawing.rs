//! The animation of a track.

use std::path::PathBuf;

use clap::Args;
use grasp_client::{GraspClient, v1};
use grasp_scene::{
    client::{ObjectLook, TrackRecording},
    to_moving_glb,
};

use crate::{Failure, blocking, output::write_file, picture::object_look};

/// What to draw of a track.
#[derive(Args, Clone, Debug)]
pub(super) struct DrawOptions {
    /// Write the motion as a binary glTF file with an animation.
    #[arg(long, value_name = "FILE", conflicts_with = "print_motion")]
    glb: Option<PathBuf>,
}

/// A track that is being recorded, to be drawn.
#[derive(Debug)]
pub(super) struct Drawing {
    pub(super) recording: TrackRecording,
    object: ObjectLook,
    glb: PathBuf,
}

impl DrawOptions {
    /// The drawing, if one is wanted.
    pub(super) async fn drawing(
        &self,
        client: &GraspClient,
        track: &v1::Track,
    ) -> Result<Option<Drawing>, Failure> {
        let Some(glb) = self.glb.clone() else {
            return Ok(None);
        };
        let holdout = track.holdout.clone().unwrap_or_default();
        Ok(Some(Drawing {
            recording: TrackRecording::new(track),
            object: object_look(client, &holdout).await?,
            glb,
        }))
    }
}

impl Drawing {
    /// Writes the file.
    pub(super) async fn write(self) -> Result<(), Failure> {
        blocking(move || {
            let handover = self.recording.handover(&self.object)?;
            write_file(&self.glb, &to_moving_glb(&handover))
        })
        .await
    }
}
