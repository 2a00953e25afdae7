//! Any one saved file damaged in any way: the server starts, still lists everything, says by name what is lost, and serves the rest.

use std::{
    fmt::Debug,
    path::{Path, PathBuf},
};

use grasp_cases::cases;
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::*;

/// What is lost of the object `a`, with the rig `mine` and other objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Loss {
    Nothing,
    Record,
    Mesh,
    Rig,
}

/// What may happen to a file.
fn damaged(mut bytes: Vec<u8>, random: &mut Xoshiro256PlusPlus) -> (String, Option<Vec<u8>>) {
    let place = random.random_range(0..bytes.len().max(1));
    let about = match random.random_range(0..6) {
        0 => return ("missing".to_owned(), None),
        1 => {
            bytes.truncate(place);
            format!("cut at {place}")
        }
        2 => {
            bytes.push(random.random());
            "with another byte".to_owned()
        }
        3 => {
            bytes.fill(0);
            "all zero".to_owned()
        }
        _ if bytes.is_empty() => return ("missing".to_owned(), None),
        _ => {
            bytes[place] ^= 1 << random.random_range(0..8);
            format!("another bit at {place}")
        }
    };
    (about, Some(bytes))
}

/// The answer's value, or the status' code and reason.
fn outcome<T: Debug>(answer: Result<T, Status>) -> Result<T, (Code, String)> {
    answer.map_err(|status| (status.code(), reason(&status)))
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let (folders, mut files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    files.extend(folders.iter().flat_map(|folder| self::files(folder)));
    files.sort();
    files
}

async fn check(folder: &Folder, loss: Loss, about: &str) {
    let server = start(folder, 10).await;
    let lost = |reason: &str| Err((Code::DataLoss, reason.to_owned()));
    let of_record = lost("OBJECT_DAMAGED").map(|()| "objects/a");
    let listed = all(&server).await;
    let names: Vec<_> = listed
        .iter()
        .filter(|object| !object.built_in)
        .map(|object| &object.name)
        .collect();
    assert_eq!(names, ["objects/a", "objects/b"], "{about}");
    for (name, mesh_loss, record_loss) in [
        (
            "objects/a",
            matches!(loss, Loss::Mesh | Loss::Record),
            loss == Loss::Record,
        ),
        ("objects/b", false, false),
    ] {
        let got = outcome(get(&server, name).await);
        let expected = if record_loss { of_record.clone() } else { Ok(name) };
        assert_eq!(got.map(|_| name), expected, "{about}");
        let found = outcome(server.grasps().await.find_grasp(held_out(name)).await);
        let found = found.map(|answer| answer.into_inner().grasps.len());
        let expected = if mesh_loss {
            lost("OBJECT_DAMAGED").map(|()| 1)
        } else {
            Ok(1)
        };
        assert_eq!(found, expected, "{about}: {name}");
    }
    let rigs = all_rigs(&server).await;
    assert!(rigs.iter().any(|rig| rig.name == "rigs/mine"), "{about}");
    let name = "rigs/mine".to_owned();
    let rig = outcome(server.rigs().await.get_rig(v1::GetRigRequest { name }).await).map(|_| ());
    let expected = if loss == Loss::Rig {
        lost("RIG_DAMAGED")
    } else {
        Ok(())
    };
    assert_eq!(rig, expected, "{about}");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn whatever_is_damaged_of_a_file_is_data_loss_by_name_and_the_rest_is_served() {
    let folder = Folder::absent("saved-any-damage");
    let server = start(&folder, 10).await;
    create(&server, box_request("a")).await.unwrap();
    let larger = with_object(box_request("b"), |object| object.meters_per_unit = Some(1.1));
    let larger = v1::CreateObjectRequest {
        mesh: [BOX_OBJ.as_bytes(), b"# another mesh"].concat(),
        ..larger
    };
    create(&server, larger).await.unwrap();
    create_rig(&server, "mine").await.unwrap();
    server.stop().await;
    let of_a = folder.path().join("meshes").join(sha256(BOX_OBJ.as_bytes()));
    let saved: Vec<_> = files(folder.path())
        .into_iter()
        .map(|path| (fs::read(&path).unwrap(), path))
        .collect();
    // Two records and meshes, a rig, two files of names, two marks, and the lock.
    assert_eq!(saved.len(), 10, "{saved:?}");
    let (mut tried, mut lost) = (0, 0);
    for seed in 0..u64::from(cases(400)) {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let (bytes, path) = &saved[seed as usize % saved.len()];
        let relative = path.strip_prefix(folder.path()).unwrap().to_str().unwrap();
        let loss = match relative {
            "objects/a" => Loss::Record,
            "rigs/mine" => Loss::Rig,
            _ if *path == of_a => Loss::Mesh,
            _ if relative.starts_with("meshes/")
                && path.extension().is_none_or(|extension| extension != "grasp")
                || relative == "objects/b" =>
            {
                continue;
            }
            _ => Loss::Nothing,
        };
        let (damage, wrong) = damaged(bytes.clone(), &mut random);
        match wrong {
            Some(wrong) => fs::write(path, wrong).unwrap(),
            None => fs::remove_file(path).unwrap(),
        }
        check(&folder, loss, &format!("seed {seed}, {relative} {damage}")).await;
        fs::write(path, bytes).unwrap();
        tried += 1;
        lost += u32::from(loss != Loss::Nothing);
    }
    println!("{tried} damaged files, {lost} of them DATA_LOSS by name, all others served");
}
