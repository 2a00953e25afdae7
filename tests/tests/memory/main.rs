//! How much memory reading a mesh takes, and an object once it is read. In a binary of its own, because it counts allocations.

use std::{
    collections::BTreeMap,
    f32::consts::PI,
    fs,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use base64::{Engine as _, prelude::BASE64_STANDARD};
use glam::Vec3;
use grasp_assets::hands::hand;
use grasp_characters::{
    glb,
    ring::{Ring, floats},
};
use grasp_import::{Import, MeshLimits, read_mesh};
use grasp_synthesis::{
    base::stop::unstopped,
    geometry::mesh::TriangleMesh,
    model::{hand::Handedness, object::GraspObject, plain_object::PlainObject},
    propose::prepared::PreparedObject,
};
use peak_alloc::PeakAlloc;
use serde_json::{Value, json};

#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// Held by the one test that runs: others would count in its figures.
fn alone() -> MutexGuard<'static, ()> {
    static RUNS: Mutex<()> = Mutex::new(());
    RUNS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Memory that reading may take at its peak, what it returns included, as a multiple of the file.
const BYTES_PER_BYTE: usize = 6;

/// Rows and columns of vertices: 100,352 triangles.
const SIDE: u32 = 224;

const LIMITS: MeshLimits = MeshLimits {
    bytes: 64 << 20,
    vertices: 200_000,
    triangles: 200_000,
};

/// A ring whose coordinates have five digits, as files have them.
fn rounded_ring() -> Ring {
    let mut ring = Ring::at([0.0; 3], SIDE);
    for number in ring.positions.as_flattened_mut() {
        *number = (*number * 1e5).round() / 1e5;
    }
    ring
}

/// The document of a ring without names, with more members of its buffer.
fn nameless(ring: &Ring, buffer: &str) -> Value {
    let mut document: Value = serde_json::from_str(&ring.gltf_json("", buffer)).expect("it is JSON");
    document["nodes"] = json!([{"mesh": 0}]);
    document["materials"] = json!([{}]);
    document["meshes"][0]["name"].take();
    document
}

fn glb_of_16_bits(ring: &Ring) -> Vec<u8> {
    let mut document = nameless(ring, "");
    let mut buffer = floats(ring.positions.as_flattened());
    let indices = ring.triangles.as_flattened().iter();
    buffer.extend(indices.flat_map(|&index| (index as u16).to_le_bytes()));
    document["accessors"][1]["componentType"] = 5123.into();
    document["bufferViews"][1]["byteLength"] = (6 * ring.triangles.len()).into();
    document["buffers"][0]["byteLength"] = buffer.len().into();
    glb(&document, buffer)
}

fn gltf_text(ring: &Ring) -> Vec<u8> {
    let data = BASE64_STANDARD.encode(ring.buffer());
    let uri = format!(r#","uri":"data:application/octet-stream;base64,{data}""#);
    nameless(ring, &uri).to_string().into_bytes()
}

/// Writes a file.
type Write = fn(&Ring) -> Vec<u8>;

#[test]
fn reading_takes_at_most_six_times_the_file() {
    let _alone = alone();
    let ring = rounded_ring();
    let files: [(&str, Write); 8] = [
        ("OBJ of triangles", |ring| ring.obj(false)),
        ("OBJ of both", |ring| ring.obj(true)),
        ("STL text", Ring::stl_text),
        ("binary STL", Ring::stl_binary),
        ("PLY text", |ring| ring.ply("ascii")),
        ("binary PLY", |ring| ring.ply("binary_little_endian")),
        ("GLB of 16 bits", glb_of_16_bits),
        ("glTF text", gltf_text),
    ];
    let mut too_much = Vec::new();
    for (name, write) in files {
        let file = write(&ring);
        let before = ALLOCATOR.current_usage();
        ALLOCATOR.reset_peak_usage();
        let read = read_mesh(&file, Import::METRES, LIMITS).expect("the ring is sound");
        let peak = ALLOCATOR.peak_usage() - before;
        let share = peak as f64 / file.len() as f64;
        println!("{name}: {share:.2} times {} bytes", file.len());
        assert_eq!(read.mesh.triangles().len(), ring.triangles.len(), "{name}");
        assert_eq!(read.warnings, [""; 0], "{name}");
        if peak > BYTES_PER_BYTE * file.len() {
            too_much.push(format!("{name}: {share:.2}"));
        }
    }
    assert_eq!(too_much, [""; 0]);
}

/// Memory that reading a small file may take besides: the OBJ parser keeps a hundred bytes for some hundred faces.
const BYTES_BESIDES: usize = 64 << 10;

/// Reached only if something hangs, even without optimisation on a busy machine.
const HANGS_AFTER: Duration = Duration::from_secs(20);

/// The mesh files of the test data. A file that is refused says so; below it are the starts of its warnings or errors.
const EXPECTED: &str = include_str!("expected.txt");

#[test]
fn every_file_becomes_what_is_expected_in_bounded_time_and_memory() {
    let _alone = alone();
    let root = std::env::var_os("GRASP_TEST_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")),
        PathBuf::from,
    );
    let mut expected: BTreeMap<&str, (bool, Vec<&str>)> = BTreeMap::new();
    let mut name = "";
    for line in EXPECTED.lines() {
        if let Some(text) = line.strip_prefix("    ") {
            expected.get_mut(name).expect("a file comes first").1.push(text);
        } else {
            let refused = line.strip_suffix(" is refused");
            name = refused.unwrap_or(line);
            expected.insert(name, (refused.is_none(), Vec::new()));
        }
    }
    let found = meshes(&root);
    if found.is_empty() {
        eprintln!(
            "SKIPPED: no test data in {}; GRASP_TEST_DATA names their folder",
            root.display()
        );
        return;
    }
    for name in found {
        let (is_mesh, texts) = expected
            .get(name.as_str())
            .unwrap_or_else(|| panic!("{name} is not in the table"));
        let bytes = fs::read(root.join(&name)).unwrap();
        let before = ALLOCATOR.current_usage();
        ALLOCATOR.reset_peak_usage();
        let started = Instant::now();
        let read = read_mesh(&bytes, Import::METRES, LIMITS);
        let (time, peak) = (started.elapsed(), ALLOCATOR.peak_usage() - before);
        assert!(time < HANGS_AFTER, "{name}: {time:?}");
        let allowed = BYTES_PER_BYTE * bytes.len() + BYTES_BESIDES;
        assert!(peak <= allowed, "{name}: {peak} bytes for {}", bytes.len());
        assert_eq!(read.is_ok(), *is_mesh, "{name}");
        let found = match read {
            Ok(read) => read.warnings,
            Err(errors) => errors.iter().map(ToString::to_string).collect(),
        };
        assert_eq!(found.len(), texts.len(), "{name}: {found:#?}");
        for (found, text) in found.iter().zip(texts) {
            assert!(found.starts_with(text), "{name}: {text:?}, not {found:?}");
        }
    }
}

/// The paths of all mesh files of the test data.
fn meshes(root: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = ["objects", "ugly", "reports"]
        .map(|folder| root.join(folder))
        .to_vec();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            let extension = path.extension().unwrap_or_default().to_str();
            if path.is_dir() {
                folders.push(path);
            } else if extension.is_some_and(|own| ["obj", "stl", "ply", "glb", "gltf"].contains(&own)) {
                found.push(path.strip_prefix(root).unwrap().to_string_lossy().into_owned());
            }
        }
    }
    found.sort();
    found
}

/// Memory that an object may take at rest: a multiple of its mesh, and bytes in any case.
const MESHES: usize = 3;
const BYTES_AT_REST: usize = 64 << 10;

/// Memory of data derived from it, beside the hierarchy of its triangles.
const BYTES_DERIVED: usize = 400_000;

/// Largest error of an estimate, as a share, and bytes of allocations that nobody counts.
const ERROR: f64 = 0.05;
const UNCOUNTED: f64 = 16_384.0;

/// A bumpy ellipsoid of the size of a computer mouse, of `2 * side * (side - 1)` triangles.
fn ellipsoid(side: u32) -> TriangleMesh {
    let point = |row: u32, column: u32| {
        let polar = PI * row as f32 / side as f32;
        let around = 2.0 * PI * column as f32 / side as f32;
        let (sin, cos) = polar.sin_cos();
        let direction = Vec3::new(sin * around.cos(), sin * around.sin(), cos);
        direction * Vec3::new(0.026, 0.018, 0.06) * (1.0 + 0.04 * (3.0 * polar).sin() * (4.0 * around).sin())
    };
    let mut positions = vec![point(0, 0), point(side, 0)];
    positions.extend((1..side).flat_map(|row| (0..side).map(move |column| point(row, column))));
    let at = |row: u32, column: u32| match row {
        0 => 0,
        _ if row == side => 1,
        _ => 2 + (row - 1) * side + column % side,
    };
    let mut triangles = Vec::with_capacity((2 * side * (side - 1)) as usize);
    for row in 0..side {
        for column in 0..side {
            let [a, b] = [row, row + 1].map(|row| at(row, column));
            let [d, c] = [row, row + 1].map(|row| at(row, column + 1));
            if row + 1 < side {
                triangles.push([a, b, c]);
            }
            if row > 0 {
                triangles.push([a, c, d]);
            }
        }
    }
    TriangleMesh::new(positions, triangles).expect("the mesh is sound")
}

fn assert_agree(estimate: usize, measured: usize, what: &str) {
    let (estimate, measured) = (estimate as f64, measured as f64);
    assert!(
        (estimate - measured).abs() <= ERROR * measured + UNCOUNTED,
        "{what}: estimated {estimate}, measured {measured}"
    );
}

#[test]
fn memory_is_bounded_and_estimated_rightly() {
    let _alone = alone();
    let hands =
        [Handedness::Left, Handedness::Right].map(|side| hand("adult", side).expect("it is built in"));
    for hand in hands {
        hand.rig.oppositions();
    }
    for side in [32, 101] {
        let (before, mesh) = (ALLOCATOR.current_usage(), ellipsoid(side));
        let triangles = mesh.triangles().len();
        let of_mesh = size_of_val(mesh.positions()) + size_of_val(mesh.triangles());
        let plain = unstopped(|stop| PlainObject::new_until(mesh, 0.1, Vec3::ZERO, None, &[], stop));
        let plain = plain.expect("the object is sound");
        let at_rest = ALLOCATOR.current_usage() - before;
        assert_agree(plain.bytes(), at_rest, "at rest");
        assert!(
            at_rest <= MESHES * of_mesh + BYTES_AT_REST,
            "{triangles} triangles: {at_rest}"
        );

        let before = ALLOCATOR.current_usage();
        let object = unstopped(|stop| GraspObject::of_until(plain, stop));
        let prepared = PreparedObject::new(Arc::new(object));
        for hand in hands {
            prepared.placement_cache(&hand.rig);
        }
        let derived = ALLOCATOR.current_usage() - before;
        let surface = &prepared.surface;
        let of_hierarchy = surface.bytes() - surface.distance_field_bytes();
        println!(
            "{triangles} triangles: {at_rest} bytes at rest, {derived} derived, {of_hierarchy} of them the hierarchy"
        );
        assert_agree(prepared.derived_bytes(), derived, "derived");
        assert!(
            derived - of_hierarchy <= BYTES_DERIVED,
            "{triangles} triangles: {derived}"
        );
    }
}
