//! Registers objects, follows the growth of their atlases, and takes them from test givers.

use std::time::{Duration, Instant};

use grasp_client::{
    ClientError, Code, GraspChoice, GraspClient, Handedness, Outcome,
    v1::{self, Atlas, AtlasGrowth, GraspObject, receiver::Body},
};
use grasp_server::FolderObject;
use prost::Message as _;
use sha2::{Digest as _, Sha256};
use uuid::Builder;

use super::{Givers, Grips, Row};
use crate::{
    Failure,
    bake::folder::{NewObject, new_object},
    blocking,
    input::id_from_file,
    objects::atlas_of,
    output::{joined, list, name_of, rejections_at_a_glance},
};

/// Time without growth of any atlas after which they are given up: the server then has no memory for them.
const STALLED: Duration = Duration::from_mins(2);

/// Time limit of the search for a giver's hold, and of the search that shows what is in the way.
const HOLD_BUDGET: Duration = Duration::from_secs(1);

/// Creates an object unless an earlier run did. Its row lists its violations.
pub(super) async fn register(
    client: &GraspClient,
    file: FolderObject,
    replace: bool,
) -> Result<Row, Failure> {
    let mesh = file.mesh.file_name().unwrap_or_default();
    let mut row = Row {
        name: format!("objects/{}", id_from_file(&file.mesh)),
        mesh: mesh.to_string_lossy().into_owned(),
        ..Row::default()
    };
    let NewObject { request, density } = match blocking(move || Ok(new_object(file))).await? {
        Ok(new) => new,
        Err(wrong) => {
            row.error = Some(wrong);
            return Ok(row);
        }
    };
    row.density = density;
    let mut object = request;
    object.request_id = request_id(&object);
    let before = match client.get_object(&row.name).await {
        Err(error) if error.code() == Some(Code::NotFound) => None,
        before => Some(before?),
    };
    let mut created = client.create_object(&object).await;
    let exists = |error: &ClientError| error.code() == Some(Code::AlreadyExists);
    if replace && created.as_ref().is_err_and(exists) {
        client.delete_object(&row.name, None).await?;
        created = client.create_object(&object).await;
    }
    let error = match created {
        Ok(created) => {
            row.created = before.is_none_or(|before| before.create_time != created.create_time);
            describe(client, &mut row, &created).await?;
            return Ok(row);
        }
        Err(error) => error,
    };
    row.error = Some(match error.call() {
        Some(call) if call.code == Code::AlreadyExists => {
            "was created from another file; --replace deletes that object first".to_owned()
        }
        Some(call) if matches!(call.code, Code::InvalidArgument | Code::FailedPrecondition) => {
            let violations = call.violations().iter();
            let all = violations.map(|wrong| format!("{}: {}", wrong.field, wrong.description));
            let all = joined("; ", all);
            if all.is_empty() { call.message.clone() } else { all }
        }
        _ => return Err(error.into()),
    });
    Ok(row)
}

/// A UUID from a hash of the request: the same object has the same id in every run.
fn request_id(request: &v1::CreateObjectRequest) -> String {
    // Messages are encoded in order of their fields and of the keys of maps.
    let hash = Sha256::digest(request.encode_to_vec());
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&hash[..16]);
    Builder::from_custom_bytes(bytes).into_uuid().to_string()
}

async fn describe(client: &GraspClient, row: &mut Row, object: &GraspObject) -> Result<(), Failure> {
    row.mass_kg = Some(object.mass_kg);
    row.triangles = Some(object.triangle_count);
    row.warnings.clone_from(&object.warnings);
    let atlases = [
        atlas_of(client, &row.name, "right").await?,
        atlas_of(client, &row.name, "left").await?,
    ];
    row.growth = why_not_growing(&atlases);
    let are_kept = atlases
        .iter()
        .any(|atlas| atlas.growth != 0 || atlas.entry_count > 0);
    row.grips = are_kept.then(|| {
        atlases.map(|atlas| Grips {
            entries: atlas.entry_count,
            complete: matches!(atlas.growth(), AtlasGrowth::Complete | AtlasGrowth::NothingFound),
        })
    });
    Ok(())
}

/// Why the atlases of the right and the left hand have stopped growing, if the server says.
fn why_not_growing(atlases: &[Atlas; 2]) -> Option<String> {
    let both = ["right", "left"].into_iter().zip(atlases);
    let reasons = list(both.filter_map(|(side, atlas)| {
        let why = match atlas.growth() {
            AtlasGrowth::Unspecified | AtlasGrowth::Complete | AtlasGrowth::Growing => return None,
            AtlasGrowth::NothingFound => "of thousands of hands tried, none holds it".to_owned(),
            AtlasGrowth::NoMemory => "the server has no memory for it (cache_bytes)".to_owned(),
            AtlasGrowth::Failed => "the server failed to grow it; its log says how".to_owned(),
            other => name_of(other),
        };
        Some(format!("{side} hand: {why}"))
    }));
    (!reasons.is_empty()).then_some(reasons)
}

/// Reads the state of an object whose atlases grow; true if they are complete, or never will be. `grew` is when an atlas of any
/// object last grew.
pub(super) async fn is_done(
    client: &GraspClient,
    row: &mut Row,
    grew: &mut Instant,
) -> Result<bool, Failure> {
    let before = row.grips;
    match client.get_object(&row.name).await {
        Err(error) if error.code() == Some(Code::NotFound) => {
            row.error = Some("was deleted or evicted meanwhile".to_owned());
            return Ok(true);
        }
        object => describe(client, row, &object?).await?,
    }
    if row.grips != before {
        *grew = Instant::now();
    } else if grew.elapsed() > STALLED {
        row.stalled = true;
        return Ok(true);
    }
    // A server without atlases has nothing to wait for.
    let Some(grips) = row.grips else { return Ok(true) };
    let is_complete = grips.iter().all(|hand| hand.complete);
    if !is_complete && grips.iter().all(|hand| hand.entries == 0) {
        // A search makes the server load an unloaded object, so that its atlas grows on.
        let mut request = v1::FindGraspRequest::new(&row.name).with_budget(Duration::from_millis(10));
        request.search_mut().max_attempts = Some(1);
        client.find_grasp(&request).await?;
    }
    Ok(is_complete)
}

/// Takes an object from so many givers, half of them left-handed, with the better hand. Each giver's hold is found by a search with
/// its own seed and without the atlas: reproducible, and independent of the atlas.
pub(super) async fn try_givers(
    client: &GraspClient,
    object: &str,
    givers: u16,
    budget: Duration,
) -> Result<Givers, Failure> {
    let mut result = Givers {
        requested: givers,
        ..Givers::default()
    };
    for seed in 0..givers {
        let handedness = [Handedness::Right, Handedness::Left][usize::from(seed % 2)];
        let mut hold = v1::FindGraspRequest::new(object)
            .receiving(handedness)
            .with_seed(seed.into())
            .with_budget(HOLD_BUDGET);
        hold.receiver_mut().body = Some(Body::Anywhere(true));
        hold.search_mut().ignore_atlas = true;
        hold.search_mut().set_choice(GraspChoice::Reproducible);
        let Some(giver) = client.find_grasp(&hold).await?.hand().cloned() else {
            continue;
        };
        result.tried += 1;
        let take = v1::FindGraspRequest::new(object)
            .with_presenting_hand(giver)
            .with_seed(seed.into())
            .with_budget(budget);
        let answer = client.find_grasp(&take).await?;
        if answer.outcome() == Outcome::Found {
            result.answered += 1;
        } else {
            result.last_failure = Some(why_no_grasp(&answer.report.unwrap_or_default()));
        }
    }
    Ok(result)
}

/// Why hands cannot hold an object alone, without a giver; `None` if a search finds a grasp.
pub(super) async fn in_the_way(client: &GraspClient, object: &str) -> Result<Option<String>, Failure> {
    let mut request = v1::FindGraspRequest::new(object)
        .with_budget(HOLD_BUDGET)
        .with_seed(1);
    request.receiver_mut().body = Some(Body::Anywhere(true));
    let answer = client.find_grasp(&request).await?;
    let is_found = answer.outcome() == Outcome::Found;
    Ok((!is_found).then(|| why_no_grasp(&answer.report.unwrap_or_default())))
}

fn why_no_grasp(report: &v1::SearchReport) -> String {
    if report.limits.is_empty() {
        let rejections = rejections_at_a_glance(report);
        return format!("none of {} hands tried holds it ({rejections})", report.attempts);
    }
    let limits = report.limits.iter().map(|limit| &limit.description);
    format!("limited by {}", joined("; ", limits))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn request_ids_depend_on_content_alone() {
        let object = v1::CreateObjectRequest::new("mug", b"v 0 0 0", 0.3);
        assert_eq!(request_id(&object), request_id(&object.clone()));
        let mut labelled = object.clone();
        labelled.object_mut().labels = [("level".to_owned(), String::new())].into();
        let other_mesh = v1::CreateObjectRequest {
            mesh: b"v 0 0 1".to_vec(),
            ..object.clone()
        };
        for other in [other_mesh, labelled] {
            assert_ne!(request_id(&other), request_id(&object));
        }
    }
}
