"""The compose file: the service, and a container that drives it."""

import os

import pytest
from conftest import ROOT, run, skip

# What the client says of a server that is not there.
NO_ANSWER = 5


@pytest.fixture
def compose():
    if not os.environ.get("GRASP_COMPOSE"):
        skip(f"compose file: {os.environ.get('GRASP_NO_COMPOSE') or 'tests/container/run was not used'}")

    def running(*files_and_command):
        return run("docker", "compose", "--file", "docker/compose.yaml", *files_and_command, cwd=ROOT)

    yield running
    running("down", "--timeout", "5")


def test_the_test_container_s_verdict_is_the_exit_code(compose):
    up = ("up", "--build", "--exit-code-from", "test")
    passed = compose(*up)
    assert passed.returncode == 0, passed.stdout[-4000:] + passed.stderr[-4000:]
    assert "found" in passed.stdout + passed.stderr
    compose("down", "--timeout", "5")
    failed = compose("--file", "tests/container/failing.yaml", *up)
    assert failed.returncode == NO_ANSWER, failed.stdout[-4000:] + failed.stderr[-4000:]
