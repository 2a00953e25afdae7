//! `grasp bake`, against a real server.

use std::{
    fs,
    net::Ipv6Addr,
    path::{Path, PathBuf},
};

use grasp_server::{Config, config::StorePlace};
use serde_json::{Value, json};
use tokio::{net::TcpListener, sync::oneshot, task::JoinHandle};

use crate::{
    commands::{code, empty_folder, json, run, text},
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
        let listener = TcpListener::bind((Ipv6Addr::LOCALHOST, 0)).await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let config = Config {
            builder_threads: 0,
            place: StorePlace::Folder(folder.to_owned()),
            ..Config::default()
        };
        let (stop, stopped) = oneshot::channel();
        let serving = tokio::spawn(async move {
            let stopped = async {
                let _ = stopped.await;
            };
            grasp_server::run(listener, config, stopped).await.unwrap();
        });
        Self { url, stop, serving }
    }

    async fn stop(self) {
        let _ = self.stop.send(());
        self.serving.await.unwrap();
    }

    /// The rows of a run that ends with this exit code.
    fn bake(&self, folder: &Path, more: &[&str], expected: i32) -> Vec<Value> {
        let folder = folder.to_str().unwrap();
        let common = ["bake", folder, "--json", "--server", &self.url];
        let output = run(&[&common, more].concat());
        assert_eq!(code(&output), expected, "{}", text(&output.stderr));
        json(&output.stdout).as_array().expect("a list").clone()
    }
}

/// A folder with a box that has a manifest, a box of wood without one, and a file that is no mesh.
fn meshes(name: &str) -> PathBuf {
    let folder = empty_folder(name);
    fs::write(folder.join("Tea Tin.obj"), BOX_OBJ).unwrap();
    fs::write(
        folder.join("Tea Tin.toml"),
        "mass_kg = 0.2\n[labels]\nlevel = \"hall\"\n",
    )
    .unwrap();
    fs::write(folder.join("block.obj"), format!("usemtl Oak.Wood\n{BOX_OBJ}")).unwrap();
    fs::write(folder.join("empty.obj"), "v 0 0 0\n").unwrap();
    folder
}

#[tokio::test(flavor = "multi_thread")]
async fn a_folder_is_registered_once() {
    let folder = meshes("baked_once");
    let store = empty_folder("baked_once_store");
    let server = Server::start(&store).await;
    let first = server.bake(&folder, &["--givers", "2"], 4);
    let [tin, block, empty] = &first[..] else {
        panic!("{first:?}");
    };
    assert_eq!(
        (&tin["name"], &tin["created"]),
        (&json!("objects/tea-tin"), &json!(true))
    );
    assert_eq!((&tin["density"], &tin["triangles"]), (&Value::Null, &json!(12)));
    assert_eq!(
        block["density"],
        json!({ "material": "wood", "kg_per_m3": 650.0 })
    );
    assert_eq!(
        tin["givers"],
        json!({ "requested": 2, "tried": 2, "answered": 2, "last_failure": null })
    );
    assert_eq!(
        (&empty["created"], empty["error"].is_string()),
        (&json!(false), true)
    );
    server.stop().await;

    // After a restart, nothing is created again, and a changed file is not taken for the old one.
    let server = Server::start(&store).await;
    fs::write(folder.join("Tea Tin.toml"), "mass_kg = 0.3\n").unwrap();
    fs::remove_file(folder.join("empty.obj")).unwrap();
    let second = server.bake(&folder, &["--givers", "0"], 4);
    let [tin, block] = &second[..] else {
        panic!("{second:?}");
    };
    assert!(tin["error"].as_str().unwrap().contains("--replace"), "{tin}");
    assert_eq!(
        (&block["created"], &block["error"]),
        (&json!(false), &Value::Null)
    );
    let third = server.bake(&folder, &["--givers", "0", "--replace"], 0);
    let created: Vec<&Value> = third.iter().map(|row| &row["created"]).collect();
    assert_eq!(created, [&json!(true), &json!(false)]);
    assert!((third[0]["mass_kg"].as_f64().unwrap() - 0.3).abs() < 1e-6);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_that_no_hand_holds_is_told_with_what_is_in_the_way() {
    let folder = empty_folder("baked_in_vain");
    fs::write(folder.join("anvil.obj"), BOX_OBJ).unwrap();
    fs::write(folder.join("anvil.toml"), "mass_kg = 80\n").unwrap();
    let server = Server::start(&empty_folder("baked_in_vain_store")).await;
    let rows = server.bake(&folder, &["--givers", "1"], 3);
    let anvil = &rows[0];
    assert_eq!(
        (&anvil["error"], &anvil["givers"]["tried"]),
        (&Value::Null, &json!(0))
    );
    let why = anvil["in_the_way"].as_str().unwrap();
    assert!(why.starts_with("limited by mass: 80.0 kg"), "{why}");
    let output = run(&[
        "bake",
        folder.to_str().unwrap(),
        "--givers",
        "1",
        "--server",
        &server.url,
    ]);
    assert_eq!(code(&output), 3);
    // The table may break lines.
    let table = text(&output.stdout)
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(table.contains("0 of 1"), "{table}");
    server.stop().await;
}
