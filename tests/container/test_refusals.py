"""What keeps the service from starting is told, and ends it with 1."""

import json

from conftest import grasp, limits_memory, skip

# Settings for a container of 256 MiB, as docker/README.md has them.
SMALL = {
    "GRASP_CACHE_BYTES": str(64 << 20),
    "GRASP_MAXIMUM_UPLOADS": "1",
    "GRASP_MAXIMUM_SEARCHES": "4",
    "GRASP_MAXIMUM_CONNECTIONS": "100",
}


def test_every_bad_setting_is_named(refused):
    log = refused(environment={"GRASP_WORKERS": "0", "GRASP_DEFAULT_RIG": "robot", "GRASP_LISTEN": "here"})
    for part in ("workers is 0", 'default_rig is "robot"', 'listen is "here"'):
        assert part in log, log


def test_everything_wrong_with_a_folder_of_objects_is_told(refused, objects):
    (objects / "my-remote.toml").write_text("mass_kg = -1\ncolour = 'red'\n")
    (objects / "orphan.toml").write_text("mass_kg = 1\n")
    (objects / "scissors.obj").write_text("v 0 0 0\n")
    (objects / "scissors.toml").write_text("mass_kg = 1\n")
    log = refused(mounts={objects: "/objects"})
    error = json.loads(log.splitlines()[-1])["error"]
    for part in (
        "my-remote.toml: mass_kg: is -1; it must be more than 0",
        "my-remote.toml: colour: is unknown",
        "orphan.toml: has no orphan.obj next to it",
        "scissors.obj: has the name of the built-in object",
    ):
        assert part in error, error


def test_a_folder_that_is_not_mounted_is_told(refused):
    error = json.loads(refused(environment={"GRASP_OBJECTS_DIRECTORY": "/elsewhere"}).splitlines()[-1])["error"]
    assert error.startswith("objects_directory is /elsewhere; "), error


def test_too_little_memory_is_told(refused):
    # By a control group where the engine may set one, else by a resource limit.
    limit, source = ["--memory", "256m"], "memory"
    if not limits_memory():
        limit, source = ["--ulimit", f"data={256 << 20}:{256 << 20}"], "RLIMIT_DATA"
        print("the engine cannot limit memory by a control group here; by RLIMIT_DATA instead")
    log = refused(*limit)
    error = json.loads(log.splitlines()[-1])["error"]
    assert "too little memory: the limit is 256 MiB" in error and source in error, error
    for part in ("cache_bytes is ", "maximum_uploads is ", "maximum_searches is "):
        assert part in error, error


def test_settings_that_fit_the_memory_survive_their_load(start, tmp_path):
    if not limits_memory():
        skip("load within a memory limit: the engine cannot set one here")
    service = start("--memory", "256m", environment=SMALL)
    mesh = tmp_path / "large.obj"
    write_wavy_sheet(mesh, 315)
    for number in range(4):
        created = grasp(service.address(), "objects", "create", "--obj", mesh, "--mass", "1", f"large-{number}")
        assert created.returncode == 0, created.stderr
    # One of them fits the cache: the others were evicted.
    listed = json.loads(grasp(service.address(), "objects", "list", "--json").stdout)["objects"]
    assert sum(thing["name"].startswith("objects/large-") for thing in listed) == 1
    assert service.is_running()


def write_wavy_sheet(path, edge):
    """A sheet of 2 * edge * edge triangles, 10 cm wide."""
    lines = [
        f"v {0.1 * x / edge:.5f} {0.1 * y / edge:.5f} {0.004 * ((x // 9 + y // 7) % 3):.5f}\n"
        for x in range(edge + 1)
        for y in range(edge + 1)
    ]
    for x in range(edge):
        for y in range(edge):
            a = 1 + x * (edge + 1) + y
            b = a + edge + 1
            lines.append(f"f {a} {b} {b + 1} {a + 1}\n")
    path.write_text("".join(lines))
