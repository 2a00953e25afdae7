//! Lists of objects: filters, orders and pages.

use grasp_client::RetryPolicy;
use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    fixtures::{blamed_fields, box_request, reason},
    parts::{forbidden, with_object},
};

/// A box with labels.
fn labelled(id: &str, labels: &[(&str, &str)]) -> v1::CreateObjectRequest {
    let owned = labels
        .iter()
        .map(|&(key, value)| (key.to_owned(), value.to_owned()));
    with_object(box_request(id), |object| object.labels = owned.collect())
}

/// The ids of all objects of a list, in its order.
async fn ids(server: &TestServer, filter: &str, order_by: &str, page_size: i32) -> Vec<String> {
    let mut client = server.objects().await;
    let mut ids = Vec::new();
    let mut page_token = String::new();
    loop {
        let request = v1::ListObjectsRequest {
            page_size,
            page_token,
            filter: filter.to_owned(),
            order_by: order_by.to_owned(),
            ..Default::default()
        };
        let page = client.list_objects(request).await.unwrap().into_inner();
        assert!(page_size == 0 || page.objects.len() <= usize::try_from(page_size).unwrap());
        let names = page
            .objects
            .iter()
            .map(|object| object.name.strip_prefix("objects/").unwrap());
        ids.extend(names.map(str::to_owned));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return ids;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn filters_select_by_labels_and_orders_sort() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    for (id, labels) in [
        ("pan", &[("level", "kitchen"), ("owner", "Ada L.")][..]),
        ("cup", &[("level", "kitchen"), ("fragile", "")]),
        ("saw", &[("level", "cellar")]),
    ] {
        client.create_object(labelled(id, labels)).await.unwrap();
    }
    for page_size in [0, 1, 2] {
        for (filter, order_by, expected) in [
            ("labels.level = \"kitchen\"", "", &["cup", "pan"][..]),
            ("labels.level = \"kitchen\"", "create_time", &["pan", "cup"]),
            ("name = \"objects/sc*\"", "name desc", &["scissors", "scalpel"]),
            (
                "labels.level = \"kitchen\" AND labels.owner = \"Ada L.\" AND name = \"objects/p*\"",
                "",
                &["pan"],
            ),
            ("labels.level = \"attic\"", "", &[]),
            (
                "",
                "name desc",
                &["scissors", "scalpel", "saw", "remote", "pan", "cup"],
            ),
        ] {
            assert_eq!(
                ids(&server, filter, order_by, page_size).await,
                expected,
                "{filter}"
            );
        }
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_belongs_to_its_list() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    let first = v1::ListObjectsRequest {
        page_size: 1,
        ..Default::default()
    };
    let token = client
        .list_objects(first)
        .await
        .unwrap()
        .into_inner()
        .next_page_token;
    let other = v1::ListObjectsRequest {
        page_token: token,
        order_by: "name desc".to_owned(),
        ..Default::default()
    };
    let status = client.list_objects(other).await.unwrap_err();
    assert_eq!(
        (status.code(), blamed_fields(&status)),
        (Code::InvalidArgument, vec!["page_token".to_owned()])
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn only_a_full_list_has_regions_and_known_grips() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    let request = with_object(box_request("crate"), |object| {
        object.regions = vec![forbidden(&[], &[0])];
        object.known_grips = vec![v1::KnownGrip {
            name: "never".to_owned(),
            preference: v1::Preference::Forbidden.into(),
            hand: Some(v1::HandPose {
                rig: "rigs/adult".to_owned(),
                handedness: v1::Handedness::Left.into(),
                object_from_wrist: Some(v1::Pose::default()),
                ..Default::default()
            }),
            ..Default::default()
        }];
    });
    let created = client.create_object(request).await.unwrap().into_inner();
    assert_eq!((created.regions.len(), created.known_grips.len()), (1, 1));
    for (view, expected) in [
        (v1::ObjectView::Unspecified, 0),
        (v1::ObjectView::Basic, 0),
        (v1::ObjectView::Full, 1),
    ] {
        let request = v1::ListObjectsRequest {
            page_size: 1,
            view: view.into(),
            ..Default::default()
        };
        let page = client.list_objects(request).await.unwrap().into_inner();
        let listed = &page.objects[0];
        assert_eq!(listed.name, created.name);
        assert_eq!(
            (listed.regions.len(), listed.known_grips.len()),
            (expected, expected)
        );
        assert_eq!(listed.forbidden_triangle_count, 1);
        if view == v1::ObjectView::Full {
            assert_eq!(listed, &created);
        }
    }
    let wrong = v1::ListObjectsRequest {
        view: 9,
        ..Default::default()
    };
    let status = client.list_objects(wrong).await.unwrap_err();
    assert_eq!(blamed_fields(&status), ["view"]);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_client_lists_with_a_query() {
    let server = TestServer::start().await;
    server
        .objects()
        .await
        .create_object(labelled("cup", &[("level", "kitchen")]))
        .await
        .unwrap();
    let client = grasp_client::GraspClient::builder(server.endpoint())
        .retry(RetryPolicy::NEVER)
        .connect()
        .await
        .unwrap();
    let query = v1::ListObjectsRequest {
        filter: "labels.level = \"kitchen\"".to_owned(),
        order_by: "create_time desc".to_owned(),
        ..Default::default()
    };
    let objects = client.list_objects(&query).await.unwrap();
    assert_eq!(objects.len(), 1);
    assert_eq!(objects[0].labels["level"], "kitchen");
    assert_eq!(objects[0].create_time, objects[0].update_time);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn only_methods_that_build_objects_take_large_messages() {
    let server = TestServer::start().await;
    let mut client = server.objects().await;
    let large = "n".repeat(1 << 20);
    let get = v1::GetObjectRequest { name: large.clone() };
    let status = client.get_object(get).await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::OutOfRange, "MESSAGE_TOO_LARGE".to_owned())
    );
    let list = v1::ListObjectsRequest {
        filter: large,
        ..Default::default()
    };
    let status = client.list_objects(list).await.unwrap_err();
    assert_eq!(status.code(), Code::OutOfRange);
    server.stop().await;
}
