//! The pictures and scenes of the demo.

use std::path::{Path, PathBuf};

use grasp_scene::{Image, contact_sheet};

use super::demo_progress::DemoProgress;
use crate::{
    blocking,
    failure::Failure,
    picture::{Picture, write_file},
    values::ViewSize,
};

/// What to draw.
#[derive(Debug)]
pub(super) struct Drawing {
    /// Name of the files.
    pub(super) name: String,
    /// Line below it in the overview.
    pub(super) caption: String,
    pub(super) picture: Picture,
}

/// The sizes of the pictures.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// Pixels of each of a picture's two views.
    pub(super) view_size: ViewSize,
    /// Pixels of a view in the overview, unless the pictures are smaller.
    pub(super) small_view: ViewSize,
    /// Pictures per row of the overview.
    pub(super) columns: usize,
}

/// The files written.
#[derive(Debug)]
pub(super) struct Drawn {
    pub(super) pictures: Vec<PathBuf>,
    pub(super) scenes: Vec<PathBuf>,
    pub(super) overview: Option<PathBuf>,
}

/// Writes a picture and a scene of each answer, and an overview picture.
pub(super) async fn draw_all(
    drawings: Vec<Drawing>,
    folder: &Path,
    layout: Layout,
    progress: &DemoProgress,
) -> Result<Drawn, Failure> {
    let size = layout.view_size;
    let small_size = ViewSize {
        width: size.width.min(layout.small_view.width),
        height: size.height.min(layout.small_view.height),
    };
    let mut drawn = Drawn {
        pictures: Vec::new(),
        scenes: Vec::new(),
        overview: None,
    };
    let mut small_pictures = Vec::new();
    for Drawing {
        name,
        caption,
        picture,
    } in drawings
    {
        progress.step(&format!("drawing {name}"));
        let png = folder.join(format!("{name}.png"));
        let glb = folder.join(format!("{name}.glb"));
        let (png_path, glb_path) = (png.clone(), glb.clone());
        let small = blocking(move || {
            write_file(&png_path, &picture.draw(size)?.to_png())?;
            write_file(&glb_path, &picture.to_glb()?)?;
            picture.draw_best_view(small_size)
        })
        .await?;
        small_pictures.push((small, caption));
        drawn.pictures.push(png);
        drawn.scenes.push(glb);
    }
    progress.step("drawing the overview");
    drawn.overview = write_overview(small_pictures, folder, layout.columns).await?;
    Ok(drawn)
}

async fn write_overview(
    pictures: Vec<(Image, String)>,
    folder: &Path,
    columns: usize,
) -> Result<Option<PathBuf>, Failure> {
    let path = folder.join("overview.png");
    blocking(move || {
        let Some(sheet) = contact_sheet(&pictures, columns) else {
            return Ok(None);
        };
        write_file(&path, &sheet.to_png())?;
        Ok(Some(path))
    })
    .await
}
