//! Parts of requests and answers.

use std::time::Duration;

use glam::Vec3;
use grasp_proto::v1;

/// A value after a change.
pub(crate) fn with<T>(mut value: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut value);
    value
}

/// A request whose answer is the same for any number of workers.
pub(crate) fn reproducible(request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    with(request, |request| {
        request.search_mut().choice = v1::GraspChoice::Reproducible.into();
    })
}

/// A request to create an object that `change` has changed.
pub(crate) fn with_object(
    request: v1::CreateObjectRequest,
    change: impl FnOnce(&mut v1::GraspObject),
) -> v1::CreateObjectRequest {
    with(request, |request| change(request.object_mut()))
}

/// A change of the object of this name to what `change` sets.
pub(crate) fn update_of(name: &str, change: impl FnOnce(&mut v1::GraspObject)) -> v1::UpdateObjectRequest {
    let object = v1::GraspObject {
        name: name.to_owned(),
        ..Default::default()
    };
    v1::UpdateObjectRequest {
        object: Some(with(object, change)),
        update_mask: None,
    }
}

/// The same with a mask.
pub(crate) fn masked(paths: &[&str], request: v1::UpdateObjectRequest) -> v1::UpdateObjectRequest {
    let paths = paths.iter().map(|&path| path.to_owned()).collect();
    v1::UpdateObjectRequest {
        update_mask: Some(prost_types::FieldMask { paths }),
        ..request
    }
}

/// A region of which hands keep off.
pub(crate) fn forbidden(groups: &[&str], triangles: &[u32]) -> v1::Region {
    v1::Region {
        groups: groups.iter().map(|&group| group.to_owned()).collect(),
        triangles: triangles.to_vec(),
        ..v1::Region::new("forbidden", v1::Preference::Forbidden)
    }
}

/// The budget of a search that was in force.
pub(crate) fn budget_of(answer: &v1::FindGraspResponse) -> Duration {
    let budget = answer.report.as_ref().and_then(|report| report.budget);
    let budget = budget.expect("it is always reported");
    budget.try_into().expect("it is not negative")
}

/// The hand of a grasp.
pub(crate) fn hand(grasp: &v1::Grasp) -> &v1::HandPose {
    grasp.hand.as_ref().expect("a grasp has a hand")
}

/// A vector that is there.
pub(crate) fn vec3(vector: Option<v1::Vector3>) -> Vec3 {
    vector.expect("there is a vector").into()
}
