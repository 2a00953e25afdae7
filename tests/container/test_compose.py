"""Tests the compose file: the service and a container that calls it."""

import os
import time

import pytest
from conftest import ENGINE, HANGS_AFTER, ROOT, engine, run, skip

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


def test_exit_code_is_that_of_the_test_container(compose):
    up = ("up", "--build", "--exit-code-from", "test")
    if os.environ["GRASP_COMPOSE"].endswith("podman-compose"):
        serve(compose)
    passed = compose(*up)
    assert passed.returncode == 0, passed.stdout[-4000:] + passed.stderr[-4000:]
    assert "found" in passed.stdout + passed.stderr
    compose("down", "--timeout", "5")
    failed = compose("--file", "tests/container/failing.yaml", *up)
    assert failed.returncode == UNREACHABLE, failed.stdout[-4000:] + failed.stderr[-4000:]
