"""Starts containers of the image under test with minimal privileges, and calls them with the client."""

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

# Only what the server needs. podman would add writable folders to a read-only root.
HARDENED = ["--read-only", "--cap-drop", "ALL", "--security-opt", "no-new-privileges"]
if ENGINE == "podman":
    HARDENED.append("--read-only-tmpfs=false")

# Seconds after which anything that is waited for counts as hung.
HANGS_AFTER = 60


def run(*command, **options):
    """Runs a command and captures its output, in files because podman-compose leaves processes that hold pipes open."""
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        done = subprocess.run(command, stdout=out, stderr=err, timeout=540, **options)
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(command, done.returncode, out.read(), err.read())


def engine(*arguments):
    """Runs an engine command that must succeed; returns its standard output."""
    done = run(ENGINE, *arguments)
    assert done.returncode == 0, f"{ENGINE} {' '.join(arguments)}: {done.stderr}"
    return done.stdout.strip()


def inspect(name, template):
    return engine("inspect", "--format", template, name)


def skip(reason):
    """Skips the test and reports the reason at the end of tests/run."""
    with (WORK / "skipped").open("a") as skipped:
        print(f"container: {reason}", file=skipped)
    pytest.skip(reason)


def limits_memory():
    """Whether the engine can set a memory limit, rather than failing or printing a warning."""
    done = run(ENGINE, "run", "--rm", "--memory", "256m", IMAGE, "--print-config")
    return done.returncode == 0 and "limit" not in done.stderr.lower()


def report_figure(what, value):
    """Prints a figure that no test checks."""
    print(f"measured: {what}: {value}")


def grasp(address, *arguments):
    """Runs the client on the host against a server."""
    environment = {**os.environ, "GRASP_SERVER": f"http://{address}"}
    return run(ROOT / "target/release/grasp", *arguments, env=environment)


def wait_for(what, condition):
    deadline = time.monotonic() + HANGS_AFTER
    while not condition():
        assert time.monotonic() < deadline, f"{what} did not happen within {HANGS_AFTER} s"
        time.sleep(0.02)


class Service:
    """A started container."""

    def __init__(self, name):
        self.name = name

    def address(self):
        """Its host:port on the host; the engine picks a new port at every start."""
        host, port = engine("port", self.name, PORT).splitlines()[0].rsplit(":", 1)
        return f"{'127.0.0.1' if host in ('0.0.0.0', '::', '[::]') else host}:{port}"

    def wait_until_it_serves(self):
        def serves():
            assert self.is_running(), f"the container exited: {self.log()}"
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
    """A function that starts a service; the test's services are removed when it ends."""
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
def log_of_rejected():
    """A function that runs the server with settings that it must reject, and returns its log."""

    def running(*options, environment=None, mounts=None):
        done = run(ENGINE, "run", "--rm", *options_for(environment or {}, mounts or {}), *options, IMAGE)
        assert done.returncode == 1, f"exit code {done.returncode}: {done.stdout}{done.stderr}"
        return done.stdout + done.stderr

    return running


@pytest.fixture
def host_server():
    """The address of the same server on the host, with the same configuration."""
    process = subprocess.Popen(
        [ROOT / "target/release/grasp-server", "--listen", "127.0.0.1:0"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={"NO_COLOR": "1", "GRASP_STORE": "memory"},
    )
    for line in process.stderr:
        if match := re.search(r"127\.0\.0\.1:\d+", line):
            yield match.group(0)
            break
    process.terminate()
    process.communicate(timeout=HANGS_AFTER)


@pytest.fixture
def objects(tmp_path):
    """A folder that holds the built-in remote under another name, readable by the container's user."""
    folder = tmp_path / "objects"
    folder.mkdir()
    shutil.copy(ROOT / "assets/objects/remote.obj", folder / "my-remote.obj")
    about = json.loads((ROOT / "assets/objects/remote.json").read_text())
    (folder / "my-remote.toml").write_text(
        f"mass_kg = {about['mass_kg']}\n"
        f"center_of_mass = {about['centre_of_mass_m']}\n"
        f"[[regions]]\nname = 'front'\npreference = 'forbidden'\ngroups = {about['forbidden_groups']}\n"
    )
    # Independent of this process' umask.
    folder.chmod(0o755)
    for path in folder.iterdir():
        path.chmod(0o644)
    return folder
