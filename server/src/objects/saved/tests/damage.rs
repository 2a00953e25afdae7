//! Files of saved objects that are damaged, missing or open to other users.

use super::*;

/// The error of an object whose record or mesh is damaged.
fn damaged(id: &str) -> ServiceError {
    ServiceError::ObjectDamaged { name: name_of(id) }
}

/// Puts these bytes in place of a file, or nothing.
fn spoil(path: &std::path::Path, wrong: Option<&[u8]>) {
    match wrong {
        Some(bytes) => fs::write(path, bytes).unwrap(),
        None => fs::remove_file(path).unwrap(),
    }
}

#[test]
fn a_record_that_is_changed_cut_short_or_missing_is_data_loss_until_it_is_back_or_deleted() {
    let folder = Folder::new();
    let before = create(&folder.objects(), "a", 1).unwrap();
    create(&folder.objects(), "b", 2).unwrap();
    let path = folder.record("a");
    let whole = fs::read(&path).unwrap();
    let mut changed = whole.clone();
    changed[40] ^= 1;
    for wrong in [Some(&changed[..]), Some(&whole[..50]), Some(&[]), None] {
        spoil(&path, wrong);
        let objects = folder.objects();
        assert_eq!(objects.get("a").map(|_| ()), Err(damaged("a")));
        assert_eq!(wait_for(objects.found("a")).map(|_| ()), Err(damaged("a")));
        assert_eq!(objects.changeable("a", None).map(|_| ()), Err(damaged("a")));
        assert_eq!(
            objects.remove("a", Some("1-1"), &Caller::default()),
            Err(damaged("a"))
        );
        // Its name and its mesh are kept.
        let exists = ServiceError::ObjectExists { name: name_of("a") };
        assert_eq!(create(&objects, "a", 3).map(|_| ()), Err(exists));
        assert_eq!(folder.names(MESHES).len(), 2);
        assert!(listed(&objects, 100, "").iter().any(|id| id == "a"));
        fs::write(&path, &whole).unwrap();
        let found = wait_for(objects.found("a")).unwrap();
        assert_eq!(found.to_wire(), before.to_wire());
        wait_for(objects.loaded("a")).unwrap();
    }
    fs::write(&path, "not a record").unwrap();
    folder.objects().remove("a", None, &Caller::default()).unwrap();
    let objects = folder.objects();
    let gone = objects.get("a").unwrap_err();
    assert!(matches!(gone, ServiceError::ObjectNotFound { .. }), "{gone}");
    create(&objects, "a", 1).unwrap();
}

#[test]
fn a_mesh_that_is_changed_cut_short_or_missing_is_data_loss_until_it_is_back() {
    let folder = Folder::new();
    create(&folder.objects(), "a", 1).unwrap();
    let path = folder.path.join(MESHES).join(&folder.names(MESHES)[0]);
    let whole = fs::read(&path).unwrap();
    let changed = (0..whole.len()).map(|place| {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x20;
        Some(bytes)
    });
    let cut = (0..whole.len())
        .step_by(7)
        .map(|length| Some(whole[..length].to_vec()));
    for wrong in changed.chain(cut).chain([None]) {
        spoil(&path, wrong.as_deref());
        let objects = folder.objects();
        for _ in 0..2 {
            let loaded = wait_for(objects.loaded("a")).map(|_| ());
            assert_eq!(loaded, Err(damaged("a")), "{wrong:?}");
        }
        fs::write(&path, &whole).unwrap();
        wait_for(objects.loaded("a")).unwrap();
    }
    // Created again, it is whole.
    fs::remove_file(&path).unwrap();
    let objects = folder.objects();
    objects.remove("a", None, &Caller::default()).unwrap();
    create(&objects, "a", 1).unwrap();
    drop(objects);
    wait_for(folder.objects().loaded("a")).unwrap();
}

#[test]
fn a_store_without_all_of_its_meshes_or_records_is_refused_and_left_as_it_is() {
    for (several, lost) in [(false, MESHES), (false, OBJECTS), (true, MESHES), (true, OBJECTS)] {
        let folder = Folder::new();
        let objects = folder.objects();
        create(&objects, "a", 1).unwrap();
        if several {
            create(&objects, "b", 2).unwrap();
        }
        drop(objects);
        let check_refused = || {
            let found = folder.open(10).and_then(|saved| wait_for(saved.read_all()));
            let error = found.map(|_| ()).expect_err("it must not start").to_string();
            assert!(error.contains(lost), "{error}");
        };
        // Its volume is not mounted: there is no folder, or an empty one.
        let (of, away) = (folder.path.join(lost), folder.path.join("away"));
        fs::rename(&of, &away).unwrap();
        check_refused();
        fs::create_dir(&of).unwrap();
        check_refused();
        fs::remove_dir(&of).unwrap();
        fs::rename(&away, &of).unwrap();
        wait_for(folder.objects().loaded("a")).unwrap();
    }
}

#[test]
fn folders_and_files_are_private_to_their_user() {
    use std::os::unix::fs::PermissionsExt as _;

    let folder = Folder::new();
    let objects = folder.objects();
    let base = create(&objects, "a", 1).unwrap();
    objects.replace(&base, labels(9), None).unwrap();
    let check = || {
        let mut checked = 0;
        let mut folders = vec![folder.path.clone()];
        while let Some(path) = folders.pop() {
            let about = fs::metadata(&path).unwrap();
            let expected = if about.is_dir() { 0o700 } else { 0o600 };
            assert_eq!(about.permissions().mode() & 0o777, expected, "{}", path.display());
            checked += 1;
            if about.is_dir() {
                folders.extend(fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path()));
            }
        }
        assert!(checked > 7, "{checked} files");
    };
    check();
    drop(objects);
    // So are files of an earlier version.
    for open in ["", OBJECTS, "objects/a"] {
        let path = folder.path.join(open);
        let mode = if path.is_dir() { 0o755 } else { 0o644 };
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    }
    drop(folder.objects());
    check();
}

#[test]
fn changing_an_object_that_is_being_deleted_is_no_damage() {
    let folder = Folder::new();
    let objects = folder.objects_of(10, 1000);
    let change = ObjectChange {
        unit_metres: Some(0.02),
        ..ObjectChange::default()
    };
    for round in 0..60 {
        create(&objects, "a", 1 + round % 3).unwrap();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let _context = RUNTIME.enter();
                objects.remove("a", None, &Caller::default()).unwrap();
            });
            for _ in 0..3 {
                for result in [
                    wait_for(objects.rebuilt("a", &change)).map(|_| ()),
                    wait_for(objects.saved_given("a")).map(|_| ()),
                ] {
                    let is_right = matches!(result, Ok(()) | Err(ServiceError::ObjectNotFound { .. }));
                    assert!(is_right, "{result:?}");
                }
            }
        });
    }
}
