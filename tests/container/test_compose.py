"""Tests the compose file: the service and a container that calls it."""

import os

import pytest
from conftest import ROOT, run, skip

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


def test_exit_code_is_that_of_the_test_container(compose):
    up = ("up", "--build", "--exit-code-from", "test")
    passed = compose(*up)
    assert passed.returncode == 0, passed.stdout[-4000:] + passed.stderr[-4000:]
    assert "found" in passed.stdout + passed.stderr
    compose("down", "--timeout", "5")
    failed = compose("--file", "tests/container/failing.yaml", *up)
    assert failed.returncode == UNREACHABLE, failed.stdout[-4000:] + failed.stderr[-4000:]
