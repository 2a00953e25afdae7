//! `grasp demo --everyday`: what the service makes of everyday objects that nobody holds out.

mod page;
mod results;

use std::time::{Duration, Instant};

use grasp_client::{GraspClient, Handedness, Outcome, Preference, v1};
use grasp_everyday::{EverydayObject, Hands, everyday_objects};

use super::{
    Plan, caption,
    demo_progress::DemoProgress,
    draw::{self, Drawing, Layout},
    local_server,
};
use crate::{
    Ending,
    failure::Failure,
    output::Output,
    picture::{Picture, everyday_look},
    values::ViewSize,
};

/// The overview: as wide as the longest caption, in about as many rows as columns.
const SMALL_VIEW: ViewSize = ViewSize {
    width: 340,
    height: 280,
};
const COLUMNS: usize = 10;

/// The result for one object.
#[derive(Clone, Debug)]
struct Asked {
    object: EverydayObject,
    request: v1::FindGraspRequest,
    answer: v1::FindGraspResponse,
    round_trip: Duration,
}

impl Asked {
    fn is_found(&self) -> bool {
        self.answer.outcome() == Outcome::Found
    }

    /// Why one hand cannot hold it; none if it can.
    fn beyond(&self) -> Option<&'static str> {
        match self.object.hands {
            Hands::One => None,
            Hands::Beyond { why } => Some(why),
        }
    }
}

/// Takes the objects with these names, or all.
pub(super) async fn run(plan: &Plan, names: &[String], output: Output) -> Result<Ending, Failure> {
    let mut objects = everyday_objects();
    if let Some(name) = names
        .iter()
        .find(|name| objects.iter().all(|object| object.name != **name))
    {
        let known: Vec<_> = objects.iter().map(|object| object.name).collect();
        return Err(Failure::Usage(format!(
            "--object {name:?} is no everyday object; these are {}",
            known.join(", ")
        )));
    }
    objects.retain(|object| names.is_empty() || names.iter().any(|name| name == object.name));
    let server = local_server::start(plan.budget).await?;
    let progress = DemoProgress::new(2 * objects.len() as u64 + 1);
    let mut asked = Vec::new();
    for object in objects {
        progress.step(&format!("asking for {}", object.name));
        asked.push(ask(object, plan, &server.client).await?);
    }
    server.stop().await?;
    let drawings = asked.iter().map(drawing).collect::<Result<_, _>>()?;
    let layout = Layout {
        view_size: plan.view_size,
        small_view: SMALL_VIEW,
        columns: COLUMNS,
    };
    let drawn = draw::draw_all(drawings, &plan.folder, layout, &progress).await?;
    let page = page::write(&plan.folder, &asked, plan.budget)?;
    progress.finish();
    results::write(plan, &page, &asked, &drawn, output)?;
    Ok(Ending::Done)
}

/// Creates an object and requests a grasp at once, with the server's defaults but for hand and time.
async fn ask(object: EverydayObject, plan: &Plan, client: &GraspClient) -> Result<Asked, Failure> {
    let created = client.create_object(&new_object(&object)).await?;
    let request = v1::FindGraspRequest::new(created.name)
        .receiving(Handedness::Right)
        .with_budget(plan.budget)
        .with_seed(plan.seed);
    let start = Instant::now();
    let answer = client.find_grasp(&request).await?;
    Ok(Asked {
        object,
        request,
        answer,
        round_trip: start.elapsed(),
    })
}

fn new_object(object: &EverydayObject) -> v1::CreateObjectRequest {
    let mut request = v1::CreateObjectRequest::new(object.name, object.obj(), object.mass_kg() as f32);
    let described = request.object_mut();
    described.center_of_mass = object.centre_of_mass().map(|centre| centre.as_vec3().into());
    described.friction = Some(object.surface.friction() as f32);
    if !object.forbidden.is_empty() {
        described.regions.push(v1::Region {
            groups: object.forbidden.iter().map(|&group| group.to_owned()).collect(),
            ..v1::Region::new("forbidden", Preference::Forbidden)
        });
    }
    request
}

fn drawing(asked: &Asked) -> Result<Drawing, Failure> {
    let look = everyday_look(&asked.object)?;
    Ok(Drawing {
        name: asked.object.name.to_owned(),
        caption: caption(asked.object.name, &asked.answer),
        picture: Picture::new(look, &asked.request)?.with_grasps(asked.answer.grasps.clone()),
    })
}
