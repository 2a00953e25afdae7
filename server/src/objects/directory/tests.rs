use std::fs;

use super::*;

const LIMITS: MeshLimits = MeshLimits {
    bytes: 1000,
    vertices: 10,
    triangles: 10,
};

const STORE: StoreLimits = StoreLimits {
    objects: 100,
    bytes: 1 << 20,
};

const TETRAHEDRON: &str =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng lid\nf 1 3 2\ng wall\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

const MASS: &str = "mass_kg = 0.2\n";

/// A test's own folder, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str, files: &[(&str, &str)]) -> Self {
        let path = std::env::temp_dir().join(format!("grasp-objects-{}-{test}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        for (name, text) in files {
            fs::write(path.join(name), text).unwrap();
        }
        Self(path)
    }

    fn load(&self) -> Result<Vec<PinnedObject>, DirectoryError> {
        load(&self.0, LIMITS, STORE)
    }

    /// Checks that these are among its problems, whose lines are returned.
    fn problems(&self, expected: &[&str]) -> Vec<String> {
        let error = self.load().expect_err("the folder is wrong");
        let problems: Vec<String> = error.problems.iter().map(ToString::to_string).collect();
        for line in expected {
            let is_there = problems.iter().any(|problem| problem == line);
            assert!(is_there, "{line}\nnot in\n{problems:#?}");
        }
        problems
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder left in the temporary directory does no harm.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[test]
fn pairs_become_objects_and_other_files_are_ignored() {
    let manifest = r#"
        mass_kg = 1
        meters_per_unit = 0.1
        center_of_mass = [0, 0.01, 2e-2]
        friction = 0.5
        [[regions]]
        name = "not here"
        preference = "forbidden"
        shapes = [{ half_space = { point = [0, 0, 5], normal = [0, 0, 1] } }]
        groups = ["lid"]
        triangles = [3]
        [[regions]]
        name = "grip"
        preference = "preferred"
        weight = 0.5
        triangles = [1]
        [[known_grips]]
        name = "from below"
        preference = "forbidden"
        hand = { handedness = "right", object_from_wrist = { position = [0, 0, -0.1] } }
        near_distance = 0.05
        [labels]
        level = "kitchen"
    "#;
    let folder = Folder::new(
        "pairs",
        &[
            ("mug.obj", TETRAHEDRON),
            ("mug.toml", manifest),
            ("block-2.obj", TETRAHEDRON),
            ("block-2.toml", MASS),
            ("mug.mtl", "newmtl red"),
            ("README", "about"),
            (".mug.toml", "not = read"),
        ],
    );
    let objects = folder.load().unwrap();
    let ids: Vec<&str> = objects.iter().map(|pinned| pinned.object.id.as_str()).collect();
    assert_eq!(ids, ["block-2", "mug"]);
    let block = &objects[0].object.object;
    // The centroid of a tetrahedron is the mean of its corners; the friction is the contract's default.
    assert!((block.centre_of_mass - glam::Vec3::splat(0.25)).length() < 1e-6);
    assert_eq!((block.mass, block.friction), (0.2, None));
    let mug = &objects[1].object.object;
    assert_eq!((mug.mass, mug.friction), (1.0, Some(0.5)));
    assert_eq!(mug.centre_of_mass, glam::Vec3::new(0.0, 0.01, 0.02));
    let forbidden: Vec<bool> = (0..4).map(|t| mug.is_forbidden(t)).collect();
    assert_eq!(forbidden, [true, false, false, true]);
    let longest = mug.mesh.positions().iter().map(|p| p.max_element());
    assert!((longest.fold(0.0, f32::max) - 0.1).abs() < 1e-6);
    assert!(objects.iter().all(|pinned| !pinned.object.built_in));
    assert_eq!(objects[1].labels["level"], "kitchen");
    assert!(objects[0].labels.is_empty());
    let given = &objects[1].object.given;
    let regions = given.regions_to_wire();
    assert_eq!((regions[1].weight, &*regions[1].triangles), (Some(0.5), &[1][..]));
    let grips = given.grips_to_wire();
    assert_eq!(
        (&*grips[0].name, grips[0].near_distance),
        ("from below", Some(0.05))
    );
    assert_eq!(given.banned().len(), 1);
}

#[test]
fn reports_all_problems_at_once() {
    let folder = Folder::new(
        "wrong",
        &[
            ("alone.obj", TETRAHEDRON),
            ("orphan.toml", MASS),
            ("remote.obj", TETRAHEDRON),
            ("remote.toml", MASS),
            ("Big Mug.obj", TETRAHEDRON),
            ("Big Mug.toml", MASS),
            ("heavy.obj", "v 0 0 0\nf 1 2 3\n"),
            (
                "heavy.toml",
                "mass_kg = 2000\nfriction = 0\nmeters_per_unit = -1\n",
            ),
            ("keys.obj", TETRAHEDRON),
            (
                "keys.toml",
                "masskg = 1\nfriction = \"high\"\nz_up = 1\ncenter_of_mass = [0, 1]\n[[regions]]\ngroup = [\"lid\"]\n\
                 triangles = [0, -1, \"two\"]\n[labels]\nlevel = 3\n",
            ),
            ("lids.obj", TETRAHEDRON),
            (
                "lids.toml",
                "mass_kg = 1\n[[regions]]\nname = \"lids\"\npreference = \"forbidden\"\ngroups = [\"lid\", \"lit\"]\ntriangles = [9]\n",
            ),
            ("long.obj", &" ".repeat(1001)),
            ("long.toml", MASS),
            ("LOUD.OBJ", TETRAHEDRON),
            ("nested.toml", MASS),
            ("torn.obj", TETRAHEDRON),
            ("torn.toml", "mass_kg = 1\n= 3\n"),
        ],
    );
    fs::create_dir_all(folder.0.join("nested.obj")).unwrap();
    let expected = [
        "nested.obj: is not a regular file",
        "LOUD.OBJ: has an extension in capitals; it must be in small letters",
        "alone.obj: has no alone.toml next to it, which must give at least mass_kg",
        "orphan.toml: has no mesh next to it: orphan.glb, orphan.gltf, orphan.obj, orphan.ply, orphan.stl",
        "Big Mug.obj: the name: is \"Big Mug\"; it must be 1 to 63 of a-z, 0-9 and -, starting with a letter",
        "heavy.toml: meters_per_unit: is -1; it must be 0.000001 to 1000",
        "heavy.toml: mass_kg: is 2000; it must be more than 0 and at most 1000",
        "heavy.toml: friction: is 0; it must be more than 0 and at most 5",
        "heavy.obj: line 2: vertex 2 does not exist; 1 are known, counted from 1 or backward from -1",
        "keys.toml: masskg: is unknown; the keys are mass_kg, meters_per_unit, z_up, center_of_mass, friction, regions, known_grips, labels, parts",
        "keys.toml: mass_kg: is missing; it must be the mass in kilograms",
        "keys.toml: friction: is \"high\"; it must be a number",
        "keys.toml: z_up: is 1; it must be true or false",
        "keys.toml: center_of_mass: is a list of 2; it must be three numbers in meters, as in [0, 0.1, 0]",
        "keys.toml: regions[0].group: is unknown; the keys are name, preference, weight, groups, triangles, shapes",
        "keys.toml: regions[0].name: is missing; it must be a text",
        "keys.toml: regions[0].preference: is missing; it must be \"preferred\", \"avoided\" or \"forbidden\"",
        "keys.toml: regions[0].triangles[1]: is -1; it must be a triangle's number, counted from 0",
        "keys.toml: regions[0].triangles[2]: is \"two\"; it must be a triangle's number, counted from 0",
        "keys.toml: labels.level: is 3; it must be a text",
        "lids.toml: regions[0].groups[1]: is \"lit\"; the mesh has \"lid\", \"wall\"",
        "lids.toml: regions[0].triangles[0]: is 9; the mesh has 4 triangles, counted from 0",
        "long.obj: has more than 1000 bytes, the limit",
        "remote.obj: has the name of the built-in object \"remote\"; choose another name",
    ];
    let problems = folder.problems(&expected);
    // The rest of the text is the TOML parser's.
    let is_torn = |problem: &String| problem.starts_with("torn.toml: is not TOML: line 2: ");
    assert!(problems.iter().any(is_torn));
    // Vertex 3 does not exist either.
    assert_eq!(problems.len(), expected.len() + 2, "{problems:#?}");
}

#[test]
fn reports_everything_wrong_with_regions_and_known_grips() {
    let types = r#"
        mass_kg = 1
        [[regions]]
        preference = "like"
        weight = "much"
        colour = "red"
        shapes = [{ tube = { points = [[0, 0]], radii = [0.1] } }, { cone = {} }, 3]
        [[known_grips]]
        name = 3
        preference = "preferred"
        [known_grips.hand]
        object_from_wrist = { position = [0, 0, 0], orientation = [0, 0, 1] }
        thumb = { base_yaw = "wide", ring = 1 }
        [[known_grips]]
        name = "nowhere"
        preference = "avoided"
        hand = 1
    "#;
    let folder = Folder::new(
        "wrong-regions",
        &[("types.obj", TETRAHEDRON), ("types.toml", types)],
    );
    folder.problems(&[
        "types.toml: regions[0].name: is missing; it must be a text",
        "types.toml: regions[0].preference: is \"like\"; it must be \"preferred\", \"avoided\" or \"forbidden\"",
        "types.toml: regions[0].weight: is \"much\"; it must be a number",
        "types.toml: regions[0].colour: is unknown; the keys are name, preference, weight, groups, triangles, shapes",
        "types.toml: regions[0].shapes[0].tube.points[0]: is a list of 2; it must be three numbers in meters, as in [0, 0.1, 0]",
        "types.toml: regions[0].shapes[1]: is a table; it must be a table with one of \"tube\", \"box\" or \"half_space\"",
        "types.toml: regions[0].shapes[2]: is 3; it must be a table with one of \"tube\", \"box\" or \"half_space\"",
        "types.toml: known_grips[0].name: is 3; it must be a text",
        "types.toml: known_grips[0].hand.handedness: is missing; it must be \"left\" or \"right\"",
        "types.toml: known_grips[0].hand.object_from_wrist.orientation: is a list of 3; it must be a quaternion x, y, z, w, as in [0, 0, 0, 1]",
        "types.toml: known_grips[0].hand.thumb.base_yaw: is \"wide\"; it must be a number",
        "types.toml: known_grips[0].hand.thumb.ring: is unknown; the keys are base_yaw, base_pitch, second_pitch, third_pitch",
        "types.toml: known_grips[1].preference: is \"avoided\"; it must be \"preferred\" or \"forbidden\"",
        "types.toml: known_grips[1].hand: is 1; it must be a table with rig, handedness, scale, object_from_wrist, thumb, index, middle, ring, little, convention",
    ]);
}

#[test]
fn rejects_a_path_that_is_not_a_readable_folder() {
    let folder = Folder::new("file", &[("file", "text")]);
    for name in ["file", "nothing"] {
        let path = folder.0.join(name);
        let text = load(&path, LIMITS, STORE).unwrap_err().to_string();
        let start = format!("objects_directory is {}; ", path.display());
        let end = "it must be a folder that the server may read";
        assert!(text.starts_with(&start) && text.ends_with(end), "{text}");
    }
}

#[test]
fn bounds_all_objects_together() {
    let [a, b] = [("a.obj", TETRAHEDRON), ("b.obj", TETRAHEDRON)];
    let folder = Folder::new("bounded", &[a, b, ("a.toml", MASS), ("b.toml", MASS)]);
    let one = folder.load().unwrap()[0].object.derived_and_own_bytes();
    let load = |objects, bytes| load(&folder.0, LIMITS, StoreLimits { objects, bytes });
    assert_eq!(load(2, 2 * one).unwrap().len(), 2);
    for (objects, bytes, problem) in [
        (1, 2 * one, "it has 2 objects; the limit is cache_objects, 1"),
        (2, 2 * one - 1, "b.obj: makes all objects so far take about"),
    ] {
        let error = load(objects, bytes).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
}

#[test]
fn lists_some_problems_and_counts_the_others() {
    let folder = Folder::new("flood", &[]);
    for number in 0..95 {
        fs::write(folder.0.join(format!("o{number}.toml")), MASS).unwrap();
    }
    for number in 0..10 {
        fs::write(folder.0.join(format!("O{number}.OBJ")), MASS).unwrap();
    }
    let error = folder.load().unwrap_err();
    assert_eq!(error.problems.len(), 105);
    assert!(error.to_string().ends_with("\nand 5 more problems"), "{error}");
}
