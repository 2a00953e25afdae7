//! The pictures and scenes of the demo.

use std::path::{Path, PathBuf};

use grasp_client::Outcome;
use grasp_scene::{Image, contact_sheet};

use super::{Asked, demo_progress::DemoProgress};
use crate::{
    blocking,
    failure::Failure,
    picture::{Model, Picture, write_file},
    values::ViewSize,
};

/// Pixels of a view in the overview, unless the pictures are smaller: a row of five fills a wide screen.
const SMALL_VIEW: ViewSize = ViewSize {
    width: 480,
    height: 400,
};

/// Pictures per row of the overview: the number of holdouts per object, which gives each object a row.
const COLUMNS: usize = 5;

/// The files written.
#[derive(Debug)]
pub(super) struct Drawn {
    pub(super) pictures: Vec<PathBuf>,
    pub(super) scenes: Vec<PathBuf>,
    pub(super) overview: Option<PathBuf>,
}

/// Writes a picture and a scene of each answer, and an overview picture.
pub(super) async fn draw_all(
    asked: &[Asked],
    folder: &Path,
    size: ViewSize,
    progress: &DemoProgress,
) -> Result<Drawn, Failure> {
    let small_size = ViewSize {
        width: size.width.min(SMALL_VIEW.width),
        height: size.height.min(SMALL_VIEW.height),
    };
    let mut drawn = Drawn {
        pictures: Vec::new(),
        scenes: Vec::new(),
        overview: None,
    };
    let mut small_pictures = Vec::new();
    for asked in asked {
        let name = &asked.holdout.name;
        progress.step(&format!("drawing {name}"));
        let png = folder.join(format!("{name}.png"));
        let glb = folder.join(format!("{name}.glb"));
        let picture = picture_of(asked)?;
        let (png_path, glb_path) = (png.clone(), glb.clone());
        let small = blocking(move || {
            write_file(&png_path, &picture.draw(size)?.to_png())?;
            write_file(&glb_path, &picture.to_glb()?)?;
            picture.draw_best_view(small_size)
        })
        .await?;
        small_pictures.push((small, caption(asked)));
        drawn.pictures.push(png);
        drawn.scenes.push(glb);
    }
    progress.step("drawing the overview");
    drawn.overview = write_overview(small_pictures, folder).await?;
    Ok(drawn)
}

async fn write_overview(pictures: Vec<(Image, String)>, folder: &Path) -> Result<Option<PathBuf>, Failure> {
    let path = folder.join("overview.png");
    blocking(move || {
        let Some(sheet) = contact_sheet(&pictures, COLUMNS) else {
            return Ok(None);
        };
        write_file(&path, &sheet.to_png())?;
        Ok(Some(path))
    })
    .await
}

fn picture_of(asked: &Asked) -> Result<Picture, Failure> {
    let object = &asked.request.object;
    let model = Model::built_in(object)
        .ok_or_else(|| Failure::Usage(format!("{object} is not built in, so it cannot be drawn")))?;
    Ok(Picture::new(model, asked.request.clone())?.with_hands(&asked.answer))
}

fn caption(asked: &Asked) -> String {
    match asked.answer.outcome {
        Outcome::Found => asked.holdout.name.clone(),
        Outcome::BudgetExhausted => format!("{}: no grasp", asked.holdout.name),
    }
}
