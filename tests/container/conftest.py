"""Containers of the image under test, as a cautious operator starts them, and the client that asks them."""

import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import time

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
WORK = ROOT / "target" / "container"
ENGINE = os.environ.get("GRASP_ENGINE", "docker")
IMAGE = "grasp-server"
PORT = "50051/tcp"

# Nothing that the server does not need. podman would put writable folders into a read-only root.
HARDENED = ["--read-only", "--cap-drop", "ALL", "--security-opt", "no-new-privileges"]
if ENGINE == "podman":
    HARDENED.append("--read-only-tmpfs=false")

# Longest that anything is waited for: never reached unless something hangs.
HANGS_AFTER = 60


def run(*command, **options):
    """Runs a command to its end; both outputs are kept as text. By files: podman-compose leaves processes behind that
    would keep a pipe open."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        done = subprocess.run(command, stdout=out, stderr=err, timeout=540, **options)
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(command, done.returncode, out.read(), err.read())


def engine(*arguments):
    """Runs a command of the engine that must succeed; returns what it prints."""
    done = run(ENGINE, *arguments)
    assert done.returncode == 0, f"{ENGINE} {' '.join(arguments)}: {done.stderr}"
    return done.stdout.strip()


def inspect(name, template):
    return engine("inspect", "--format", template, name)


def skip(reason):
    """Skips the test aloud: tests/run tells the reason at its end."""
    with (WORK / "skipped").open("a") as skipped:
        print(f"container: {reason}", file=skipped)
    pytest.skip(reason)


def limits_memory():
    """Does the engine set a memory limit, or does it refuse or only warn that it cannot?"""
    done = run(ENGINE, "run", "--rm", "--memory", "256m", IMAGE, "--print-config")
    return done.returncode == 0 and "limit" not in done.stderr.lower()


def measured(what, value):
    """A figure for a person to read; nothing depends on it."""
    print(f"measured: {what}: {value}")


def grasp(address, *arguments):
    """The client outside of the container, asking a server."""
    environment = {**os.environ, "GRASP_SERVER": f"http://{address}"}
    return run(ROOT / "target/release/grasp", *arguments, env=environment)


def wait_for(what, condition):
    deadline = time.monotonic() + HANGS_AFTER
    while not condition():
        assert time.monotonic() < deadline, f"{what} did not happen within {HANGS_AFTER} s"
        time.sleep(0.02)


class Service:
    """A container that was started."""

    def __init__(self, name):
        self.name = name

    def address(self):
        """Where the host reaches it; the engine chooses a new port at every start."""
        host, port = engine("port", self.name, PORT).splitlines()[0].rsplit(":", 1)
        return f"{'127.0.0.1' if host in ('0.0.0.0', '::', '[::]') else host}:{port}"

    def wait_until_it_serves(self):
        def serves():
            assert self.is_running(), f"it ended: {self.log()}"
            return grasp(self.address(), "health").returncode == 0

        wait_for("the service to serve", serves)

    def is_running(self):
        return inspect(self.name, "{{.State.Running}}") == "true"

    def exit_code(self):
        return int(inspect(self.name, "{{.State.ExitCode}}"))

    def log(self):
        done = run(ENGINE, "logs", self.name)
        return done.stdout + done.stderr


def options_for(environment, mounts):
    options = [*HARDENED, "--publish", "127.0.0.1::50051"]
    for key, value in environment.items():
        options += ["--env", f"{key}={value}"]
    for source, target in mounts.items():
        options += ["--volume", f"{source}:{target}:ro"]
    return options


@pytest.fixture
def start():
    """Starts services; they are removed at the end of the test."""
    names = []

    def starting(*options, environment=None, mounts=None, wait=True):
        name = f"grasp-test-{os.getpid()}-{len(names)}-{time.monotonic_ns()}"
        names.append(name)
        engine("run", "--detach", "--name", name, *options_for(environment or {}, mounts or {}), *options, IMAGE)
        service = Service(name)
        if wait:
            service.wait_until_it_serves()
        return service

    yield starting
    for name in names:
        run(ENGINE, "rm", "--force", name)


@pytest.fixture
def refused():
    """Runs the server with what it must refuse; returns its log."""

    def running(*options, environment=None, mounts=None):
        done = run(ENGINE, "run", "--rm", *options_for(environment or {}, mounts or {}), *options, IMAGE)
        assert done.returncode == 1, f"exit code {done.returncode}: {done.stdout}{done.stderr}"
        return done.stdout + done.stderr

    return running


@pytest.fixture
def outside():
    """The same server without a container, in the same configuration; its address."""
    process = subprocess.Popen(
        [ROOT / "target/release/grasp-server", "--listen", "127.0.0.1:0"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={"NO_COLOR": "1"},
    )
    for line in process.stderr:
        if match := re.search(r"127\.0\.0\.1:\d+", line):
            yield match.group(0)
            break
    process.terminate()
    process.communicate(timeout=HANGS_AFTER)


@pytest.fixture
def objects(tmp_path):
    """A folder with one object, which the container's user may read: the built-in remote under another name."""
    folder = tmp_path / "objects"
    folder.mkdir()
    shutil.copy(ROOT / "assets/objects/remote.obj", folder / "my-remote.obj")
    about = json.loads((ROOT / "assets/objects/remote.json").read_text())
    (folder / "my-remote.toml").write_text(
        f"mass_kg = {about['mass_kg']}\n"
        f"centre_of_mass = {about['centre_of_mass_m']}\n"
        f"friction = {about['friction']}\n"
        f"forbidden = {{ groups = {about['forbidden_groups']} }}\n"
    )
    # Whatever the mask of this process says.
    folder.chmod(0o755)
    for path in folder.iterdir():
        path.chmod(0o644)
    return folder
