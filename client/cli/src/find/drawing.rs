//! The picture and the scene of grasps.

use std::path::{Path, PathBuf};

use clap::Args;
use grasp_client::{GraspClient, v1};

use crate::{
    Failure, blocking,
    input::read_file,
    output::write_file,
    picture::{Picture, object_look},
    values::{ViewSize, parse_view_size},
};

/// What to draw of an answer.
#[derive(Args, Clone, Debug)]
pub(super) struct DrawOptions {
    /// Write a picture of the grasp, if one is found.
    #[arg(long, value_name = "FILE", conflicts_with = "print_request")]
    png: Option<PathBuf>,
    /// Write the scene as a binary glTF file, if a grasp is found.
    #[arg(long, value_name = "FILE", conflicts_with = "print_request")]
    glb: Option<PathBuf>,
    /// The file that the receiving hand's rig was created from, to draw the hand with its own skin.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Pixels of the picture.
    #[arg(long, value_name = "SIZE", default_value = "900x700", value_parser = parse_view_size)]
    view_size: ViewSize,
}

/// The files to write, and what they show besides grasps.
pub(super) struct Drawing {
    picture: Picture,
    options: DrawOptions,
}

impl DrawOptions {
    /// The drawing, if one is wanted.
    pub(super) async fn drawing(
        &self,
        client: &GraspClient,
        request: &v1::FindGraspRequest,
    ) -> Result<Option<Drawing>, Failure> {
        if self.png.is_none() && self.glb.is_none() {
            return Ok(None);
        }
        let holdout = request.holdout.clone().unwrap_or_default();
        let look = object_look(client, &holdout).await?;
        let model = self.model.as_deref().map(read_file).transpose()?;
        Ok(Some(Drawing {
            picture: Picture::new(look, request)?.with_model(model),
            options: self.clone(),
        }))
    }
}

impl Drawing {
    /// Writes the files; a number is added to their names.
    pub(super) async fn write(&self, grasps: &[v1::Grasp], number: Option<usize>) -> Result<(), Failure> {
        let picture = self.picture.clone().with_grasps(grasps.to_vec());
        let DrawOptions {
            png, glb, view_size, ..
        } = self.options.clone();
        blocking(move || {
            if let Some(path) = png {
                write_file(&numbered(&path, number), &picture.draw(view_size)?.to_png())?;
            }
            if let Some(path) = glb {
                write_file(&numbered(&path, number), &picture.to_glb()?)?;
            }
            Ok(())
        })
        .await
    }
}

/// `scene.glb` becomes `scene-3.glb`.
fn numbered(path: &Path, number: Option<usize>) -> PathBuf {
    let Some(number) = number else {
        return path.to_owned();
    };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = match path.extension() {
        Some(extension) => format!("{stem}-{number}.{}", extension.to_string_lossy()),
        None => format!("{stem}-{number}"),
    };
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_several_grasps_are_numbered() {
        let name = |path: &str| numbered(Path::new(path), Some(3)).display().to_string();
        assert_eq!(name("target/scene.glb"), "target/scene-3.glb");
        assert_eq!(name("scene"), "scene-3");
        assert_eq!(name("a.b/c.d.png"), "a.b/c.d-3.png");
    }
}
