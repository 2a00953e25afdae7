//! The commands about objects, with a real server.

use serde_json::json;

use crate::harness::{Call, assert_has, empty_folder, file, grasp, real_server};

/// A box of 4, 3 and 2 cm with a lid.
pub(crate) const BOX_OBJ: &str = "\
v -0.02 -0.015 -0.01\nv 0.02 -0.015 -0.01\nv 0.02 0.015 -0.01\nv -0.02 0.015 -0.01
v -0.02 -0.015 0.01\nv 0.02 -0.015 0.01\nv 0.02 0.015 0.01\nv -0.02 0.015 0.01
g lid\nf 1 4 3 2
g rest\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
";

/// A call of `grasp objects`.
fn objects(url: &str, command: &str) -> Call {
    grasp("objects").with(command).at(url)
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_is_created_changed_listed_and_deleted() {
    let url = real_server().await;
    let mesh = file(&empty_folder("the_life_of_an_object"), "Tea Tin.obj", BOX_OBJ);
    let create = objects(&url, "create").with("--mass 0.2 --label level=kitchen --label fragile --mesh");
    let created = create.arg(mesh).json();
    assert_eq!(created["name"], "objects/tea-tin");
    assert_eq!(created["labels"], json!({"fragile": "", "level": "kitchen"}));

    let update = objects(&url, "update tea-tin");
    let with_etag = update
        .with("--mass 0.3 --forbidden-group lid --label level=attic --etag")
        .arg(created["etag"].as_str().unwrap());
    let changed = with_etag.json();
    assert_has(
        &changed,
        &json!({"forbiddenTriangleCount": 2, "labels": {"level": "attic"}}),
    );
    with_etag.complains(4, "etag");
    let reset = update.with("--no-regions --no-labels").json();
    assert_has(&reset, &json!({"forbiddenTriangleCount": null, "labels": null}));
    update.ends_with(2);

    update.with("--label level=attic").json();
    let list = objects(&url, "list")
        .with("--filter")
        .arg("labels.level = \"attic\"")
        .with("--order-by")
        .arg("create_time desc");
    assert_eq!(list.json()["objects"].as_array().unwrap().len(), 1);
    let atlases = objects(&url, "atlas tea-tin").json();
    for (place, hand) in ["left", "right"].iter().enumerate() {
        let name = &atlases["atlases"][place]["name"];
        assert_eq!(*name, format!("objects/tea-tin/atlases/{hand}"));
    }
    let deleted = objects(&url, "delete tea-tin").json();
    assert_eq!(deleted["deleted"], "objects/tea-tin");
    for gone_or_built_in in ["atlas tea-tin", "delete tea-tin", "delete remote"] {
        objects(&url, gone_or_built_in).ends_with(4);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn watching_shows_rows_or_lines_of_json() {
    let watch = objects(&real_server().await, "watch --present --count 4");
    let table = watch.text();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 4, "a header and three objects: {lines:?}");
    assert!(
        lines[1].starts_with("present") && lines[1].contains("objects/remote"),
        "{lines:?}"
    );
    let lines = watch.with("--json").run().lines();
    assert_eq!(lines.len(), 4);
    assert_eq!(lines[0]["object"]["name"], "objects/remote");
    assert_eq!(lines[3], json!({"changes": ["OBJECT_CHANGE_PRESENT_END"]}));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_saved_mesh_can_be_created_again() {
    let url = real_server().await;
    let copy = empty_folder("a_saved_mesh").join("copy.glb");
    let saved = objects(&url, "mesh scissors").with("--out").arg(&copy).json();
    assert_eq!(saved["bytes"], std::fs::metadata(&copy).unwrap().len());
    let created = objects(&url, "create --mass 0.05")
        .with("--mesh")
        .arg(copy)
        .json();
    assert_eq!(created["triangleCount"], saved["object"]["triangleCount"]);
}
