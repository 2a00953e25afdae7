//! The pictures and scenes of the demo.

use std::path::PathBuf;

use grasp_scene::contact_sheet;
use indicatif::ProgressBar;

use super::{Arguments, answer::AnsweredHoldout, step};
use crate::{Failure, blocking, output::write_file, values::ViewSize};

/// Pixels of a picture in the overview, unless the others are smaller.
const SMALL_VIEW: ViewSize = ViewSize {
    width: 480,
    height: 400,
};

/// Pictures per row of the overview: a row for each built-in object.
const COLUMNS: usize = 5;

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
pub(super) async fn draw_all(
    answered: &[AnsweredHoldout],
    arguments: &Arguments,
    progress: &ProgressBar,
) -> Result<Drawn, Failure> {
    let size = arguments.view_size;
    let small_size = ViewSize {
        width: size.width.min(SMALL_VIEW.width),
        height: size.height.min(SMALL_VIEW.height),
    };
    let mut files = Vec::new();
    let mut small_pictures = Vec::new();
    for answered in answered {
        let name = &answered.holdout.name;
        step(progress, format!("drawing {name}"));
        let drawn = Files {
            picture: arguments.out.join(format!("{name}.png")),
            scene: arguments.out.join(format!("{name}.glb")),
        };
        let (png, glb) = (drawn.picture.clone(), drawn.scene.clone());
        let picture = answered.picture.clone();
        let small = blocking(move || {
            write_file(&png, &picture.draw(size)?.to_png())?;
            write_file(&glb, &picture.to_glb()?)?;
            picture.draw(small_size)
        });
        small_pictures.push((small.await?, answered.caption()));
        files.push(drawn);
    }
    step(progress, "drawing the overview".to_owned());
    let path = arguments.out.join("overview.png");
    let overview = blocking(move || {
        let Some(sheet) = contact_sheet(&small_pictures, COLUMNS) else {
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
