//! The commands about objects, and `grasp bake`, with a real server.

use std::{fs, path::Path};

use grasp_server::{Config, config::StorePlace};
use serde_json::{Value, json};
use tokio::{sync::oneshot, task::JoinHandle};

use crate::harness::{Call, assert_contains, assert_has, empty_folder, file, grasp, real_server, serve};

/// A box of 4, 3 and 2 cm with a lid.
const BOX_OBJ: &str = "\
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
    assert_eq!(saved["bytes"], fs::metadata(&copy).unwrap().len());
    let created = objects(&url, "create --mass 0.05")
        .with("--mesh")
        .arg(copy)
        .json();
    assert_eq!(created["triangleCount"], saved["object"]["triangleCount"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn grips_are_exchanged_with_isaac_sim() {
    let url = real_server().await;
    let folder = empty_folder("grips_for_isaac");
    let [mesh, found, exported] = ["mesh.glb", "found.yaml", "exported.yaml"].map(|name| folder.join(name));
    let grips = |command: &str, file: &Path| objects(&url, "grips").with(command).with("--isaac").arg(file);
    objects(&url, "mesh remote").with("--out").arg(&mesh).text();
    let create = objects(&url, "create mine --mass 0.1");
    create.with("--mesh").arg(&mesh).text();
    let find = grasp("find --request - --receiving-hand right").at(&url);
    let request = json!({"holdout": {"object": "objects/mine"}}).to_string();
    let answer = find.with("--isaac").arg(&found).input(request).json();

    // The grasp that was found becomes a known grip, which is exported as it was found.
    let imported = grips("import mine", &found).json();
    let (grip, hand) = (&imported["knownGrips"][0], &answer["grasps"][0]["hand"]);
    assert_has(
        grip,
        &json!({"name": "grasp_0", "preference": "PREFERENCE_PREFERRED"}),
    );
    for part in ["rig", "handedness", "objectFromWrist", "thumb", "little"] {
        assert_eq!(grip["hand"][part], hand[part], "{part}");
    }
    let export = grips("export mine", &exported);
    let written = export.json();
    let confidence = written["grips"][0]["confidence"].as_f64().unwrap();
    assert!(confidence > 0.3 && written["omitted"] == json!([]), "{written}");
    let text = fs::read_to_string(&exported).unwrap();
    assert_contains(
        &text,
        &[
            "pregrasp_cspace_position:\n      thumb_base_yaw: ",
            "rigs/adult/right",
        ],
    );
    let again = grips("import mine", &exported).json();
    assert_eq!(again["knownGrips"], imported["knownGrips"]);

    let panda = text
        .replace("rigs/adult/right", "/World/panda_hand")
        .replace("thumb_base_yaw", "panda_finger_joint1");
    let import = grips("import mine", &file(&folder, "panda.yaml", panda));
    import.complains(2, "--gripper");
    let left = "--gripper rigs/adult/left";
    import
        .with(left)
        .complains(2, "grasp_0: a hand has no joints panda_finger_joint1");
    export
        .with(left)
        .complains(2, "no preferred grips of rigs/adult/left");
    grips("import remote", &exported).ends_with(4);
}

/// A server without atlases that saves objects in a folder.
struct Server {
    url: String,
    stop: oneshot::Sender<()>,
    serving: JoinHandle<()>,
}

impl Server {
    async fn start(folder: &Path) -> Self {
        let config = Config {
            builder_threads: 0,
            place: StorePlace::Folder(folder.to_owned()),
            ..Config::default()
        };
        let (stop, stopped) = oneshot::channel();
        let stopped = async { stopped.await.unwrap_or_default() };
        let (url, serving) = serve(config, stopped).await;
        Self { url, stop, serving }
    }

    async fn stop(self) {
        let _ = self.stop.send(());
        self.serving.await.unwrap();
    }

    fn bake(&self, folder: &Path, options: &str) -> Call {
        grasp("bake").arg(folder).at(&self.url).with(options)
    }

    /// The rows of a run that ends with this exit code.
    fn rows(&self, folder: &Path, options: &str, expected: i32) -> Vec<Value> {
        let rows = self.bake(folder, options).with("--json").ends_with(expected);
        rows.json().as_array().expect("a list").clone()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_is_registered_once() {
    // A box with a manifest, a box of wood without one, and a file that is not a mesh.
    let folder = empty_folder("baked_once");
    file(&folder, "Tea Tin.obj", BOX_OBJ);
    let manifest = "mass_kg = 0.2\n[labels]\nlevel = \"hall\"\n";
    file(&folder, "Tea Tin.toml", manifest);
    file(&folder, "block.obj", format!("usemtl Oak.Wood\n{BOX_OBJ}"));
    let empty = file(&folder, "empty.obj", "v 0 0 0\n");
    let store = empty_folder("baked_once_store");
    let server = Server::start(&store).await;
    let first = server.rows(&folder, "--givers 2", 4);
    assert_eq!(first.len(), 3);
    let givers = json!({"requested": 2, "tried": 2, "answered": 2, "last_failure": null});
    let wood = json!({"material": "wood", "kg_per_m3": 650.0});
    assert_has(
        &first[0],
        &json!({"name": "objects/tea-tin", "created": true, "density": null, "triangles": 12, "givers": givers}),
    );
    assert_has(&first[1], &json!({"created": true, "density": wood}));
    assert_has(&first[2], &json!({"created": false}));
    assert!(first[2]["error"].is_string());
    server.stop().await;

    // After a restart, nothing is created again, and a changed file is noticed.
    let server = Server::start(&store).await;
    file(&folder, "Tea Tin.toml", "mass_kg = 0.3\n");
    fs::remove_file(empty).unwrap();
    let second = server.rows(&folder, "--givers 0", 4);
    assert_eq!(second.len(), 2);
    let error = second[0]["error"].as_str().unwrap();
    assert!(error.contains("--replace"), "{error}");
    assert_has(&second[1], &json!({"created": false, "error": null}));
    let third = server.rows(&folder, "--givers 0 --replace", 0);
    assert_has(&third[0], &json!({"created": true}));
    assert_has(&third[1], &json!({"created": false}));
    assert!((third[0]["mass_kg"].as_f64().unwrap() - 0.3).abs() < 1e-6);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bake_reports_why_no_hand_holds_an_object() {
    let folder = empty_folder("baked_in_vain");
    file(&folder, "anvil.obj", BOX_OBJ);
    file(&folder, "anvil.toml", "mass_kg = 80\n");
    let server = Server::start(&empty_folder("baked_in_vain_store")).await;
    let rows = server.rows(&folder, "--givers 1", 3);
    let anvil = &rows[0];
    assert_has(anvil, &json!({"error": null}));
    assert_has(&anvil["givers"], &json!({"tried": 0}));
    let why = anvil["in_the_way"].as_str().unwrap();
    assert!(why.starts_with("limited by mass: 80.0 kg"), "{why}");
    // The table may break lines.
    let table = server.bake(&folder, "--givers 1").ends_with(3).stdout;
    let words: Vec<&str> = table.split_whitespace().collect();
    assert!(words.join(" ").contains("0 of 1"), "{table}");
    server.stop().await;
}
