"""Inspects the images, and runs the service in containers: alone, with settings that it must reject, and by the compose file."""

import datetime
import json
import os
import pathlib
import re
import shutil
import subprocess
import time

import pytest

from conftest import ENGINE, HANGS_AFTER, IMAGE, ROOT
from conftest import engine, grasp, inspect, limits_memory, report_figure, run, skip, wait_for

FIND = ["find", "--holdout", "scissors-hold1", "--seed", "7", "--reproducible", "--budget", "10s", "--json"]


def test_answers_the_client(start):
    begin = time.monotonic()
    service = start()
    report_figure("time from the engine's start to an answer", f"{1000 * (time.monotonic() - begin):.0f} ms")
    address = service.address()
    assert grasp(address, "health").stdout.strip() == "serving"
    listed = json.loads(grasp(address, "objects", "list", "--json").stdout)
    names = [thing["name"] for thing in listed["objects"]]
    assert names == ["objects/remote", "objects/scalpel", "objects/scissors"]
    found = grasp(address, *FIND)
    assert found.returncode == 0, found.stderr


def is_nearly(one, other):
    """Equal but for the last digits: C libraries round sines differently, and answers repeat on one platform only."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(is_nearly(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(is_nearly, one, other))
    if isinstance(one, float) and isinstance(other, (int, float)):
        return abs(one - other) <= 1e-4 * max(1.0, abs(one))
    return one == other


def test_seed_gives_the_same_grasp_as_on_the_host(start, host_server):
    # A server that has just started may still be loading its atlases.
    answers = [grasp(address, *FIND, "--ignore-atlas") for address in (start().address(), host_server)]
    assert [answer.returncode for answer in answers] == [0, 0]
    in_container, on_host = (json.loads(answer.stdout)["grasps"] for answer in answers)
    assert is_nearly(in_container, on_host), (in_container, on_host)


def test_runs_without_privileges(start):
    service = start()
    process = inspect(service.name, "{{.State.Pid}}")
    status = pathlib.Path("/proc", process, "status")
    if not status.exists() or "grasp-server" not in status.read_text():
        skip("privileges of the process: its /proc is not visible from the host")
    fields = dict(line.split(":\t", 1) for line in status.read_text().splitlines() if ":\t" in line)
    assert "0" not in fields["Uid"].split()
    assert int(fields["CapEff"], 16) == 0 and int(fields["CapPrm"], 16) == 0 and int(fields["CapBnd"], 16) == 0
    assert fields["NoNewPrivs"].strip() == "1"
    report_figure("resident memory at rest", fields["VmRSS"].strip())


def test_health_check_works_inside_the_container(start):
    service = start()
    check = run(ENGINE, "exec", service.name, "/grasp-server", "--health-check")
    assert (check.returncode, check.stdout + check.stderr) == (0, "")
    # A port where nothing listens.
    check = run(ENGINE, "exec", "--env", "GRASP_LISTEN=0.0.0.0:9", service.name, "/grasp-server", "--health-check")
    assert check.returncode == 1
    assert "cannot connect to 127.0.0.1:9" in check.stdout + check.stderr


def test_engine_reports_it_healthy(start):
    service = start()
    if ENGINE == "podman":
        # podman schedules health checks with systemd, which may be missing.
        engine("healthcheck", "run", service.name)
    wait_for("health", lambda: "healthy" == inspect(service.name, "{{.State.Health.Status}}"))


def test_environment_configures_the_service(start):
    service = start(environment={"GRASP_MAXIMUM_OBJECT_TRIANGLES": "4", "GRASP_LISTEN": "0.0.0.0:50051"})
    mesh = "assets/objects/remote.obj"
    rejected = grasp(service.address(), "objects", "create", "--mesh", mesh, "--mass", "0.1", "mesh")
    assert rejected.returncode == 4
    assert "more than 4 " in rejected.stderr


def test_serves_a_mounted_folder_of_objects(start, objects, tmp_path):
    service = start(mounts={objects: "/objects"})
    about = json.loads(grasp(service.address(), "objects", "get", "my-remote", "--json").stdout)
    built_in = json.loads(grasp(service.address(), "objects", "get", "remote", "--json").stdout)
    assert about["contentHash"] == built_in["contentHash"] and not about.get("builtIn")
    found = []
    for name in ("objects/my-remote", "objects/remote"):
        request = tmp_path / "request.json"
        # Only the built-in one has an atlas by now.
        search = {"seed": "3", "choice": "GRASP_CHOICE_REPRODUCIBLE", "ignoreAtlas": True, "budget": "10s"}
        request.write_text(json.dumps({"holdout": {"object": name}, "search": search}))
        answer = grasp(service.address(), "find", "--request", request, "--json")
        assert answer.returncode == 0, answer.stderr
        found.append(json.loads(answer.stdout)["grasps"])
    assert found[0] == found[1]


def test_log_lines_are_json(start):
    service = start()
    grasp(service.address(), *FIND)
    grasp(service.address(), "objects", "get", "nothing")
    started = inspect(service.name, "{{json .State.StartedAt}}")
    engine("stop", service.name)
    lines = [json.loads(line) for line in service.log().splitlines()]
    messages = [line["message"] for line in lines]
    assert "serving" in messages and "stopped" in messages
    assert sum("FindGrasp" in json.dumps(line) for line in lines) == 1
    # The engine prints nanoseconds, Python parses microseconds.
    serving = lines[messages.index("serving")]["timestamp"]
    moments = [re.sub(r"(\.\d{6})\d*", r"\1", text.strip('"')) for text in (started, serving)]
    begin, ready = (datetime.datetime.fromisoformat(moment.replace("Z", "+00:00")) for moment in moments)
    report_figure("from the start of the container to readiness", f"{1000 * (ready - begin).total_seconds():.0f} ms")


def test_restarts_after_being_killed(start):
    service = start()
    engine("kill", "--signal", "KILL", service.name)
    wait_for("the exit", lambda: not service.is_running())
    assert service.exit_code() == 137
    engine("start", service.name)
    service.wait_until_it_serves()
    assert grasp(service.address(), *FIND).returncode == 0


def test_sigterm_stops_it_cleanly(start):
    service = start()
    begin = time.monotonic()
    engine("kill", "--signal", "TERM", service.name)
    engine("wait", service.name)
    report_figure("from SIGTERM to exit, idle", f"{1000 * (time.monotonic() - begin):.0f} ms")
    assert service.exit_code() == 0


# Bytes.
LARGEST_IMAGE = 60_000_000


def test_images_are_small():
    for image in (IMAGE, "grasp-client"):
        size = int(engine("image", "inspect", "--format", "{{.Size}}", image))
        report_figure(f"size of the image {image}", f"{size / 1e6:.1f} MB")
        assert 1_000_000 < size < LARGEST_IMAGE


def test_image_declares_user_port_health_check_and_licence():
    user = engine("image", "inspect", "--format", "{{.Config.User}}", IMAGE).split(":")[0]
    # Kubernetes' runAsNonRoot needs a number.
    assert user.isdigit() and int(user) > 0
    assert "50051/tcp" in engine("image", "inspect", "--format", "{{.Config.ExposedPorts}}", IMAGE)
    health = engine("image", "inspect", "--format", "{{.Config.Healthcheck}}", IMAGE)
    assert "CMD /grasp-server --health-check" in health and "CMD-SHELL" not in health
    labels = engine("image", "inspect", "--format", "{{.Config.Labels}}", IMAGE)
    assert "org.opencontainers.image.licenses:MIT OR Apache-2.0" in labels


def test_image_has_no_shell():
    for shell in ("/bin/sh", "/bin/bash", "/busybox/sh"):
        assert run(ENGINE, "run", "--rm", "--entrypoint", shell, IMAGE, "-c", "true").returncode != 0


def test_source_changes_reuse_the_dependency_layer(tmp_path):
    if os.environ["GRASP_PROGRAMS"] != "build":
        skip("the image's layers: only with GRASP_TEST_CASES=all")
    context = tmp_path / "context"
    # Without git, which may be missing.
    ignored = shutil.ignore_patterns("target", ".git", "node_modules", "__pycache__")
    shutil.copytree(ROOT, context, ignore=ignored)

    def build():
        """The id of the dependency layer."""
        tag = f"grasp-dependencies-{os.getpid()}"
        arguments = ["--file", "docker/Dockerfile", "--target", "dependencies", "--tag", tag, "."]
        done = subprocess.run(["docker", "build", *arguments], cwd=context, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        identity = inspect(tag, "{{.Id}}")
        engine("rmi", "--no-prune", tag) if ENGINE == "docker" else engine("untag", tag)
        return identity

    before = build()
    for source in ("server/src/lib.rs", "client/cli/src/main.rs", "server/src/serve.rs"):
        with (context / source).open("a") as file:
            file.write("// Another comment.\n")
    (context / "server/src/another.rs").write_text("//! Another file.\n")
    assert build() == before


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


# The client's exit code when it cannot reach the server.
UNREACHABLE = 5


@pytest.fixture
def compose():
    if not os.environ.get("GRASP_COMPOSE"):
        skip(f"compose file: {os.environ.get('GRASP_NO_COMPOSE') or 'tests/container/run was not used'}")

    def running(*files_and_command):
        return run("docker", "compose", "--file", "docker/compose.yaml", *files_and_command, cwd=ROOT)

    yield running
    running("down", "--timeout", "5")


def serve(compose):
    """Starts the server alone and waits until it serves: podman-compose 1.0 starts what depends on it at once, and without systemd
    podman runs no health checks."""
    started = compose("up", "--build", "--detach", "server")
    assert started.returncode == 0, started.stdout[-4000:] + started.stderr[-4000:]
    container = engine("ps", "--quiet", "--filter", "label=com.docker.compose.service=server")
    deadline = time.monotonic() + HANGS_AFTER
    while run(ENGINE, "exec", container, "/grasp-server", "--health-check").returncode != 0:
        assert time.monotonic() < deadline, engine("logs", container)
        time.sleep(0.1)


def test_exit_code_is_that_of_the_test_container(compose, tmp_path):
    up = ("up", "--build", "--exit-code-from", "test")
    if os.environ["GRASP_COMPOSE"].endswith("podman-compose"):
        serve(compose)
    passed = compose(*up)
    assert passed.returncode == 0, passed.stdout[-4000:] + passed.stderr[-4000:]
    assert "found" in passed.stdout + passed.stderr
    compose("down", "--timeout", "5")
    # The test calls a port where nothing listens.
    failing = tmp_path / "failing.yaml"
    failing.write_text("services: {test: {environment: {GRASP_SERVER: 'http://server:1'}}}\n")
    failed = compose("--file", failing, *up)
    assert failed.returncode == UNREACHABLE, failed.stdout[-4000:] + failed.stderr[-4000:]
