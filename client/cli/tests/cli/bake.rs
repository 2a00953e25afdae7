//! `grasp bake`, against a real server.

use std::{fs, path::Path};

use grasp_server::{Config, config::StorePlace};
use serde_json::{Value, json};
use tokio::{sync::oneshot, task::JoinHandle};

use crate::{
    harness::{Call, assert_has, empty_folder, file, grasp, serve},
    objects::BOX_OBJ,
};

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
    // A box that has a manifest, a box of wood without one, and a file that is no mesh.
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

    // After a restart, nothing is created again, and a changed file is not taken for the old one.
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
async fn an_object_that_no_hand_holds_is_told_with_what_is_in_the_way() {
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
