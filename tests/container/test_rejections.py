"""The service exits with 1 and logs every reason why it cannot start, and warns of limits beyond its memory."""

import json

from conftest import grasp, limits_memory, skip

# The settings that docker/README.md gives for a container of 256 MiB.
SMALL = {
    "GRASP_CACHE_BYTES": str(48 << 20),
    "GRASP_MAXIMUM_UPLOADS": "1",
    "GRASP_MAXIMUM_UPLOAD_BYTES": str(1 << 20),
    "GRASP_MAXIMUM_WATCHERS": "4",
    "GRASP_MAXIMUM_TRACKS": "4",
    "GRASP_MAXIMUM_SEARCHES": "2",
    "GRASP_MAXIMUM_CONNECTIONS": "100",
    "GRASP_MAXIMUM_UNREAD_BYTES": str(4 << 20),
    "GRASP_MAXIMUM_RIGS": "2",
}


def test_logs_every_invalid_setting(log_of_rejected):
    log = log_of_rejected(environment={"GRASP_WORKERS": "0", "GRASP_DEFAULT_RIG": "robot", "GRASP_LISTEN": "here"})
    for part in ("workers is 0", 'default_rig is "robot"', 'listen is "here"'):
        assert part in log, log


def test_logs_every_error_in_the_objects_folder(log_of_rejected, objects):
    (objects / "my-remote.toml").write_text("mass_kg = -1\ncolour = 'red'\n")
    (objects / "orphan.toml").write_text("mass_kg = 1\n")
    (objects / "scissors.obj").write_text("v 0 0 0\n")
    (objects / "scissors.toml").write_text("mass_kg = 1\n")
    log = log_of_rejected(mounts={objects: "/objects"})
    error = json.loads(log.splitlines()[-1])["error"]
    for part in (
        "my-remote.toml: mass_kg: is -1; it must be more than 0",
        "my-remote.toml: colour: is unknown",
        "orphan.toml: has no mesh next to it: orphan.glb, ",
        "scissors.obj: has the name of the built-in object",
    ):
        assert part in error, error


def test_logs_a_missing_objects_folder(log_of_rejected):
    error = json.loads(log_of_rejected(environment={"GRASP_OBJECTS_DIRECTORY": "/elsewhere"}).splitlines()[-1])["error"]
    assert error.startswith("objects_directory is /elsewhere; "), error


def test_serves_with_a_warning_if_its_limits_exceed_the_memory(start):
    # A control group if the engine can set one, else a resource limit.
    limit, source = ["--memory", "256m"], "memory"
    if not limits_memory():
        limit, source = ["--ulimit", f"data={256 << 20}:{256 << 20}"], "RLIMIT_DATA"
        print("the engine cannot limit memory with a control group here; using RLIMIT_DATA")
    log = start(*limit).log()
    lines = [line for line in log.splitlines() if "the configured limits add up to" in line]
    assert len(lines) == 1 and source in lines[0] and "cache_bytes" in lines[0], log


def test_small_settings_survive_their_largest_load(start, tmp_path):
    if not limits_memory():
        skip("load within a memory limit: the engine cannot set one here")
    service = start("--memory", "256m", environment=SMALL)
    mesh = tmp_path / "large.obj"
    write_wavy_sheet(mesh, 315)
    for number in range(4):
        created = grasp(service.address(), "objects", "create", "--mesh", mesh, "--mass", "1", f"large-{number}")
        assert created.returncode == 0, created.stderr
    # The cache holds all of them at rest, but not what searches need of more than one.
    listed = json.loads(grasp(service.address(), "objects", "list", "--json").stdout)["objects"]
    assert sum(thing["name"].startswith("objects/large-") for thing in listed) == 4
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
