//! The pictures and scenes of the demo.

use std::path::PathBuf;

use grasp_scene::contact_sheet;
use indicatif::ProgressBar;

use super::{Plan, asked::Asked, step};
use crate::{Failure, blocking, output::write_file, values::ViewSize};

/// The files written.
#[derive(Debug)]
pub(super) struct Drawn {
    /// Those of each answer.
    pub(super) files: Vec<Files>,
    pub(super) overview: Option<PathBuf>,
}

/// The files of an answer.
#[derive(Debug)]
pub(super) struct Files {
    pub(super) picture: PathBuf,
    pub(super) scene: PathBuf,
}

/// Writes a picture and a scene of each answer, and an overview picture.
pub(super) async fn draw_all<T>(
    asked: &[Asked<T>],
    plan: &Plan,
    progress: &ProgressBar,
) -> Result<Drawn, Failure> {
    let size = plan.view_size;
    let small_size = ViewSize {
        width: size.width.min(plan.small_view.width),
        height: size.height.min(plan.small_view.height),
    };
    let mut files = Vec::new();
    let mut small_pictures = Vec::new();
    for asked in asked {
        let name = asked.name;
        step(progress, format!("drawing {name}"));
        let drawn = Files {
            picture: plan.folder.join(format!("{name}.png")),
            scene: plan.folder.join(format!("{name}.glb")),
        };
        let (png, glb) = (drawn.picture.clone(), drawn.scene.clone());
        let picture = asked.picture.clone();
        let small = blocking(move || {
            write_file(&png, &picture.draw(size)?.to_png())?;
            write_file(&glb, &picture.to_glb()?)?;
            picture.draw(small_size)
        });
        small_pictures.push((small.await?, asked.caption()));
        files.push(drawn);
    }
    step(progress, "drawing the overview".to_owned());
    let path = plan.folder.join("overview.png");
    let columns = plan.columns;
    let overview = blocking(move || {
        let Some(sheet) = contact_sheet(&small_pictures, columns) else {
            return Ok(None);
        };
        write_file(&path, &sheet.to_png())?;
        Ok(Some(path))
    });
    Ok(Drawn {
        files,
        overview: overview.await?,
    })
}
