//! Objects, what happens to them, and health.

use std::time::SystemTime;

use glam::DVec3;
use grasp_proto::v1;
use tonic_health::pb::{HealthCheckResponse, health_check_response::ServingStatus};

use super::{
    Malformed, each,
    geometry_codec::{duration_from_wire, pose_from_wire, vector_from_wire},
    known_grip_codec::known_grip_from_wire,
    region_codec::region_from_wire,
    required,
};
use crate::object::{AtlasGrowth, AtlasState, Health, Object, ObjectChange, ObjectNews, ObjectPage};

fn object_fields_from_wire(object: v1::Object) -> Result<Object, Malformed> {
    if object.name.is_empty() {
        return Err(Malformed::missing("name"));
    }
    Ok(Object {
        name: object.name,
        built_in: object.built_in,
        triangle_count: object.triangle_count,
        vertex_count: object.vertex_count,
        mass_kg: object.mass_kg,
        centre_of_mass: vector_from_wire(required("centre_of_mass", object.centre_of_mass)?),
        friction: object.friction,
        forbidden_triangle_count: object.forbidden_triangle_count,
        object_from_box: pose_from_wire(object.object_from_box),
        box_half_extents: vector_from_wire(required("box_half_extents", object.box_half_extents)?),
        content_hash: object.content_hash,
        warnings: object.warnings,
        atlas: object
            .atlas
            .map(atlas_from_wire)
            .transpose()
            .map_err(|malformed| malformed.within("atlas"))?,
        left_atlas: object
            .left_atlas
            .map(atlas_from_wire)
            .transpose()
            .map_err(|malformed| malformed.within("left_atlas"))?,
        origin_in_file: object
            .origin_in_file
            .map(|origin| DVec3::new(origin.x, origin.y, origin.z)),
        regions: each("regions", object.regions, region_from_wire)?,
        known_grips: each("known_grips", object.known_grips, known_grip_from_wire)?,
        labels: object.labels,
        etag: object.etag,
        create_time: time_from_wire("create_time", object.create_time)?,
        update_time: time_from_wire("update_time", object.update_time)?,
    })
}

fn time_from_wire(field: &str, time: Option<prost_types::Timestamp>) -> Result<SystemTime, Malformed> {
    let time = required(field, time)?;
    SystemTime::try_from(time).map_err(|_| Malformed::new(field, "is beyond the clock's range"))
}

fn atlas_from_wire(atlas: v1::AtlasState) -> Result<AtlasState, Malformed> {
    let build_time = required("build_time", atlas.build_time)?;
    Ok(AtlasState {
        entries: atlas.entries,
        complete: atlas.complete,
        stamp: atlas.stamp,
        build_time: duration_from_wire("build_time", build_time)?,
        growth: match v1::AtlasGrowth::try_from(atlas.growth) {
            Ok(v1::AtlasGrowth::Waiting) => AtlasGrowth::Waiting,
            Ok(v1::AtlasGrowth::Growing) => AtlasGrowth::Growing,
            Ok(v1::AtlasGrowth::Complete) => AtlasGrowth::Complete,
            Ok(v1::AtlasGrowth::NothingFound) => AtlasGrowth::NothingFound,
            Ok(v1::AtlasGrowth::AtRest) => AtlasGrowth::AtRest,
            Ok(v1::AtlasGrowth::NoMemory) => AtlasGrowth::NoMemory,
            Ok(v1::AtlasGrowth::Failed) => AtlasGrowth::Failed,
            Ok(v1::AtlasGrowth::Unspecified) | Err(_) => AtlasGrowth::Unrecognised,
        },
        learned: atlas.learned,
    })
}

pub(crate) fn object_from_wire(object: Option<v1::Object>) -> Result<Object, Malformed> {
    object_fields_from_wire(required("object", object)?).map_err(|malformed| malformed.within("object"))
}

pub(crate) fn object_page_from_wire(page: v1::ListObjectsResponse) -> Result<ObjectPage, Malformed> {
    Ok(ObjectPage {
        objects: each("objects", page.objects, object_fields_from_wire)?,
        next_page_token: Some(page.next_page_token).filter(|token| !token.is_empty()),
    })
}

pub(crate) fn news_from_wire(news: v1::WatchObjectsResponse) -> Result<ObjectNews, Malformed> {
    let changes: Vec<ObjectChange> = news
        .changes
        .iter()
        .map(|&change| change_from_wire(change))
        .collect();
    let is_gone = matches!(
        changes.last(),
        Some(ObjectChange::Deleted | ObjectChange::Evicted)
    );
    let name = news.object.as_ref().map(|object| object.name.clone());
    let object = news.object.filter(|_| !is_gone).map(object_fields_from_wire);
    Ok(ObjectNews {
        changes,
        name,
        object: object
            .transpose()
            .map_err(|malformed| malformed.within("object"))?,
    })
}

fn change_from_wire(change: i32) -> ObjectChange {
    match v1::ObjectChange::try_from(change) {
        Ok(v1::ObjectChange::Present) => ObjectChange::Present,
        Ok(v1::ObjectChange::PresentEnd) => ObjectChange::PresentEnd,
        Ok(v1::ObjectChange::Created) => ObjectChange::Created,
        Ok(v1::ObjectChange::Updated) => ObjectChange::Updated,
        Ok(v1::ObjectChange::AtlasUseful) => ObjectChange::AtlasUseful,
        Ok(v1::ObjectChange::AtlasComplete) => ObjectChange::AtlasComplete,
        Ok(v1::ObjectChange::LeftAtlasComplete) => ObjectChange::LeftAtlasComplete,
        Ok(v1::ObjectChange::Deleted) => ObjectChange::Deleted,
        Ok(v1::ObjectChange::Evicted) => ObjectChange::Evicted,
        Ok(v1::ObjectChange::Unspecified) | Err(_) => ObjectChange::Unrecognised,
    }
}

pub(crate) fn health_from_wire(response: HealthCheckResponse) -> Health {
    match response.status() {
        ServingStatus::Serving => Health::Serving,
        ServingStatus::NotServing => Health::NotServing,
        ServingStatus::Unknown | ServingStatus::ServiceUnknown => Health::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use glam::Vec3;

    use super::*;

    fn wire_object(name: &str) -> v1::Object {
        v1::Object {
            name: name.to_owned(),
            mass_kg: 0.13,
            centre_of_mass: Some(v1::Vector3 {
                x: 0.0,
                y: 0.01,
                z: 0.0,
            }),
            box_half_extents: Some(v1::Vector3 {
                x: 0.02,
                y: 0.01,
                z: 0.09,
            }),
            warnings: vec!["12 open edges".to_owned()],
            origin_in_file: Some(v1::DoubleVector3 {
                x: 4e6,
                y: 0.0,
                z: -0.5,
            }),
            labels: [("level".to_owned(), "kitchen".to_owned())].into(),
            etag: "17-2".to_owned(),
            create_time: Some(prost_types::Timestamp {
                seconds: 1_000_000_000,
                nanos: 5,
            }),
            update_time: Some(prost_types::Timestamp::default()),
            ..v1::Object::default()
        }
    }

    #[test]
    fn converts_every_field_of_an_object() {
        let object = object_from_wire(Some(wire_object("objects/remote"))).unwrap();
        assert_eq!(object.name, "objects/remote");
        assert_eq!(object.centre_of_mass, Vec3::new(0.0, 0.01, 0.0));
        assert_eq!(object.box_half_extents, Vec3::new(0.02, 0.01, 0.09));
        assert_eq!(object.warnings, ["12 open edges"]);
        assert_eq!(object.atlas, None);
        assert_eq!(object.origin_in_file, Some(DVec3::new(4e6, 0.0, -0.5)));
        assert_eq!(
            (object.labels["level"].as_str(), object.etag.as_str()),
            ("kitchen", "17-2")
        );
        assert_eq!(
            object.create_time,
            SystemTime::UNIX_EPOCH + Duration::new(1_000_000_000, 5)
        );
        assert_eq!(object.update_time, SystemTime::UNIX_EPOCH);
    }

    #[test]
    fn news_of_an_object_that_is_gone_has_its_name_only() {
        let news = |changes: &[v1::ObjectChange], object: Option<v1::Object>| v1::WatchObjectsResponse {
            changes: changes.iter().map(|&change| change.into()).collect(),
            object,
        };
        let named = v1::Object {
            name: "objects/mug".to_owned(),
            ..Default::default()
        };
        let gone = news_from_wire(news(&[v1::ObjectChange::Deleted], Some(named.clone()))).unwrap();
        assert_eq!((gone.name.as_deref(), gone.object), (Some("objects/mug"), None));
        let replaced = news(
            &[v1::ObjectChange::Deleted, v1::ObjectChange::Created],
            Some(named),
        );
        assert_eq!(
            news_from_wire(replaced).unwrap_err().path,
            "object.centre_of_mass"
        );
        let end = news_from_wire(news(&[v1::ObjectChange::PresentEnd], None)).unwrap();
        assert_eq!((end.changes, end.name), (vec![ObjectChange::PresentEnd], None));
    }

    #[test]
    fn atlas_state_requires_its_build_time() {
        let mut wire = wire_object("objects/remote");
        wire.atlas = Some(v1::AtlasState {
            entries: 40,
            complete: true,
            stamp: "a7".to_owned(),
            build_time: Some(prost_types::Duration {
                seconds: 2,
                nanos: 500_000_000,
            }),
            growth: v1::AtlasGrowth::Complete.into(),
            learned: 3,
        });
        let atlas = object_from_wire(Some(wire.clone())).unwrap().atlas.unwrap();
        let expected = AtlasState {
            entries: 40,
            complete: true,
            stamp: "a7".to_owned(),
            build_time: Duration::from_millis(2500),
            growth: AtlasGrowth::Complete,
            learned: 3,
        };
        assert_eq!(atlas, expected);
        // A later server may know more.
        wire.atlas.as_mut().unwrap().growth = 99;
        let atlas = object_from_wire(Some(wire.clone())).unwrap().atlas.unwrap();
        assert_eq!(atlas.growth, AtlasGrowth::Unrecognised);
        wire.atlas.as_mut().unwrap().build_time = None;
        let error = object_from_wire(Some(wire)).unwrap_err();
        assert_eq!(error.path, "object.atlas.build_time");
    }

    #[test]
    fn malformed_object_of_a_page_is_named_by_index() {
        let page = v1::ListObjectsResponse {
            objects: vec![
                wire_object("objects/a"),
                v1::Object {
                    centre_of_mass: None,
                    ..wire_object("objects/b")
                },
            ],
            next_page_token: String::new(),
        };
        let error = object_page_from_wire(page).unwrap_err();
        assert_eq!(error.path, "objects[1].centre_of_mass");
    }

    #[test]
    fn empty_token_ends_the_list() {
        let page = |token: &str| {
            object_page_from_wire(v1::ListObjectsResponse {
                objects: Vec::new(),
                next_page_token: token.to_owned(),
            })
        };
        assert_eq!(page("").unwrap().next_page_token, None);
        assert_eq!(page("next").unwrap().next_page_token.as_deref(), Some("next"));
    }
}
