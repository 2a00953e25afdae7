//! The animation and the strip of pictures of a track.

use std::path::PathBuf;

use clap::Args;
use grasp_client::{GraspClient, v1};
use grasp_scene::{
    client::{ObjectLook, TrackRecording},
    to_moving_glb,
};

use crate::{
    Failure, blocking,
    output::write_file,
    picture::object_look,
    values::{ViewSize, parse_view_size},
};

/// Moments of a strip, and how many are in a row.
const MOMENTS: usize = 8;
const COLUMNS: usize = 4;

/// What to draw of a track.
#[derive(Args, Clone, Debug)]
pub(super) struct DrawOptions {
    /// Write the motion as a binary glTF file with an animation.
    #[arg(long, value_name = "FILE", conflicts_with = "print_motion")]
    glb: Option<PathBuf>,
    /// Write a strip of pictures: up to eight moments, those of changes among them.
    #[arg(long, value_name = "FILE", conflicts_with = "print_motion")]
    png: Option<PathBuf>,
    /// Pixels of each picture of the strip.
    #[arg(long, value_name = "SIZE", default_value = "480x400", value_parser = parse_view_size)]
    view_size: ViewSize,
}

/// A track that is being recorded, to be drawn.
#[derive(Debug)]
pub(super) struct Drawing {
    pub(super) recording: TrackRecording,
    object: ObjectLook,
    options: DrawOptions,
}

impl DrawOptions {
    /// The drawing, if one is wanted.
    pub(super) async fn drawing(
        &self,
        client: &GraspClient,
        track: &v1::Track,
    ) -> Result<Option<Drawing>, Failure> {
        if self.glb.is_none() && self.png.is_none() {
            return Ok(None);
        }
        let holdout = track.holdout.clone().unwrap_or_default();
        Ok(Some(Drawing {
            recording: TrackRecording::new(track),
            object: object_look(client, &holdout).await?,
            options: self.clone(),
        }))
    }
}

impl Drawing {
    /// Writes the files.
    pub(super) async fn write(self) -> Result<(), Failure> {
        blocking(move || {
            let handover = self.recording.handover(&self.object)?;
            if let Some(path) = &self.options.glb {
                write_file(path, &to_moving_glb(&handover))?;
            }
            let options = self.options.view_size.into();
            if let Some(path) = &self.options.png
                && let Some(strip) = self.recording.strip(&handover, MOMENTS, COLUMNS, options)
            {
                write_file(path, &strip.to_png())?;
            }
            Ok(())
        })
        .await
    }
}
