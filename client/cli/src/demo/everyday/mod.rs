//! `grasp demo --everyday`: what the service makes of everyday objects that nobody holds out.

mod page;
mod results;

use grasp_client::{Handedness, Preference, v1};
use grasp_everyday::{EverydayObject, Hands, everyday_objects};

use super::{Plan, asked::Asked, draw, local_server, progress_of, step};
use crate::{Failure, Output, picture::everyday_look};

impl Asked<EverydayObject> {
    /// Why one hand cannot hold it; none if it can.
    fn beyond(&self) -> Option<&'static str> {
        match self.what.hands {
            Hands::One => None,
            Hands::Beyond { why } => Some(why),
        }
    }
}

/// Takes the objects with these names, or all. Each is created and requested at once, with the server's defaults but for hand and
/// time.
pub(super) async fn run(plan: &Plan, names: &[String], output: Output) -> Result<(), Failure> {
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
    let progress = progress_of(objects.len());
    let mut all = Vec::new();
    for object in objects {
        step(&progress, format!("asking for {}", object.name));
        let created = server.client.create_object(&new_object(&object)).await?;
        let request = v1::FindGraspRequest::new(created.name)
            .receiving(Handedness::Right)
            .with_budget(plan.budget)
            .with_seed(plan.seed);
        let look = everyday_look(&object)?;
        all.push(Asked::ask(&server.client, (object.name, object), look, &request).await?);
    }
    server.stop().await?;
    let drawn = draw::draw_all(&all, plan, &progress).await?;
    let page = page::write(&plan.folder, &all, plan.budget)?;
    progress.finish_and_clear();
    results::write(plan, &page, &all, &drawn, output)
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
