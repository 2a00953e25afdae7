//! Meshes as clients send them: bytes that are not OBJ text are named, and what is read is read right.

use glam::Vec3;
use grasp_proto::v1;
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    fixtures::{BOX_OBJ, blamed_fields, box_request, floating_remote, unaided},
    parts::{with, with_object},
};

/// Half the edges of [`BOX_OBJ`] in metres, sorted.
const BOX_HALF_EXTENTS: [f32; 3] = [0.01, 0.015, 0.02];

async fn create(
    server: &TestServer,
    id: &str,
    obj: impl Into<Vec<u8>>,
) -> Result<v1::GraspObject, tonic::Status> {
    let request = v1::CreateObjectRequest {
        mesh: obj.into(),
        ..box_request(id)
    };
    let answer = server.objects().await.create_object(request).await?;
    Ok(answer.into_inner())
}

fn half_extents(object: &v1::GraspObject) -> [f32; 3] {
    let half = object.bounding_box.expect("an object has a box").half_extents();
    let mut extents = half.to_array();
    extents.sort_unstable_by(f32::total_cmp);
    extents
}

fn assert_is_the_box(object: &v1::GraspObject) {
    assert_eq!(object.triangle_count, 12);
    for (extent, expected) in half_extents(object).into_iter().zip(BOX_HALF_EXTENTS) {
        assert!((extent - expected).abs() < 1e-6, "{object:?}");
    }
}

/// The box with more numbers on each vertex.
fn with_extras(extra: impl Fn(usize) -> String) -> String {
    let mut vertex = 0;
    BOX_OBJ
        .lines()
        .map(|line| {
            if line.starts_with("v ") {
                vertex += 1;
                format!("{line} {}\n", extra(vertex))
            } else {
                format!("{line}\n")
            }
        })
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn colours_never_change_the_shape() {
    let server = TestServer::start().await;
    for (id, obj, warns) in [
        ("three", with_extras(|k| format!("0.{k} 0.5 0.25")), false),
        ("four", with_extras(|k| format!("0.{k} 0.5 0.25 1")), true),
        ("bytes", with_extras(|k| format!("{} 50 25 255", 30 * k)), true),
        ("weight-1", with_extras(|k| format!("1 0.{k} 0.5 0.25")), false),
    ] {
        let object = create(&server, id, obj).await.expect("the box is right");
        assert_is_the_box(&object);
        let warned = object
            .warnings
            .iter()
            .any(|warning| warning.contains("seven numbers"));
        assert_eq!(warned, warns, "{id}: {:?}", object.warnings);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn utf16_and_backslashes_in_comments_are_read() {
    let server = TestServer::start().await;
    let utf16: Vec<u8> = format!("\u{feff}{BOX_OBJ}")
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    let commented = BOX_OBJ
        .replace("f 1 4", "# C:\\boxes\\\nf 1 4")
        .replace('\n', "\r\n");
    for (id, obj) in [("utf16", utf16), ("commented", commented.into_bytes())] {
        let object = create(&server, id, obj).await.expect("the box is right");
        assert_is_the_box(&object);
        assert!(object.warnings.is_empty(), "{id}: {:?}", object.warnings);
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn other_formats_are_named() {
    let server = TestServer::start().await;
    let begins = "begins with a word of OBJ";
    let cases: [(&[u8], &str, &str); 6] = [
        (
            b"version https://git-lfs.github.com/spec/v1\nsize 9\n",
            "Git LFS pointer",
            begins,
        ),
        (b"<!DOCTYPE html><html></html>", "HTML", begins),
        (b"\x1F\x8B\x08\0\0", "gzip", begins),
        (b"once upon a time", "some other text", begins),
        // Formats that are read, without a mesh.
        (
            b"solid a\nfacet normal 0 0 1\nendfacet\nendsolid\n",
            "STL",
            "facet on line 2",
        ),
        (b"{\"asset\": {\"version\": \"2.0\"}}", "glTF", "has no triangles"),
    ];
    for (obj, name, reason) in cases {
        let status = create(&server, "other", obj)
            .await
            .expect_err("it is not OBJ text");
        assert_eq!(status.code(), Code::InvalidArgument);
        assert_eq!(blamed_fields(&status), ["mesh"]);
        let message = status.message();
        assert!(
            message.contains(reason) && message.contains(name),
            "{name}: {message}"
        );
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn contacts_on_a_concave_polygon_lie_on_the_surface() {
    // An L of legs 2 cm wide in a square of 8 cm, 3 cm thick. Its caps are hexagons, whose fans from the corner next to
    // the notch would span it.
    let outline = [(0, 0), (8, 0), (8, 2), (2, 2), (2, 8), (0, 8)];
    let vertices: Vec<_> = [0, 3]
        .iter()
        .flat_map(|z| outline.map(|(x, y)| format!("v {x} {y} {z}\n")))
        .collect();
    let sides: Vec<_> = (1..=6)
        .map(|k| format!("f {k} {} {} {}\n", k % 6 + 1, k % 6 + 7, k + 6))
        .collect();
    let server = TestServer::start().await;
    let request = v1::CreateObjectRequest {
        mesh: format!(
            "{}{}f 9 10 11 12 7 8\nf 2 1 6 5 4 3\n",
            vertices.concat(),
            sides.concat()
        )
        .into_bytes(),
        ..with_object(box_request("profile"), |object| {
            object.meters_per_unit = Some(0.01);
        })
    };
    let object = server.objects().await.create_object(request).await.unwrap();
    let object = object.into_inner();
    assert_eq!(object.triangle_count, 20);
    assert_eq!(object.warnings, [""; 0]);
    let centre = object.center_of_mass.unwrap();
    let expected = (16.0 * 4.0 + 12.0 * 1.0) / 28.0 * 0.01;
    assert!((centre.x - expected).abs() < 1e-5, "{centre:?}");

    let mut contacts = 0;
    for seed in 1..=10 {
        let request = with(unaided(floating_remote()).with_seed(seed), |request| {
            request.holdout_mut().object.clone_from(&object.name);
        });
        let answer = server
            .grasps()
            .await
            .find_grasp(request)
            .await
            .unwrap()
            .into_inner();
        for contact in answer.grasp().into_iter().flat_map(|grasp| &grasp.contacts) {
            contacts += 1;
            let p = contact.position() * 100.0;
            // The distance to the L's solid from outside: the nearer of its two legs.
            let outside = |high: Vec3| (p - p.clamp(Vec3::ZERO, high)).length();
            let distance = outside(Vec3::new(8.0, 2.0, 3.0)).min(outside(Vec3::new(2.0, 8.0, 3.0)));
            assert!(distance < 0.01, "{distance} cm off at {p}");
        }
    }
    assert!(contacts >= 20, "{contacts}");
    server.stop().await;
}
