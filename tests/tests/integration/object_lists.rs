//! Lists of objects: filters, orders and pages.

use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::fixtures::{blamed_fields, box_request, forbidden, with_object};

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
}
