"""Runs every command of docker/README.md in its order, as printed except for ports and container names.

`docker` is the engine under test, and builds use the build image that is available; see tests/container/run. A free
port and unique names keep the commands apart from whatever else runs on the machine.
"""

import os
import pathlib
import re
import socket
import time

import pytest
from conftest import HANGS_AFTER, ROOT, limits_memory, run, skip

README = ROOT / "docker" / "README.md"

# The host port that the page publishes, and the containers that its commands start.
PUBLISHED = "127.0.0.1:50051"
CONTAINERS = ("grasp", "grasp-objects", "grasp-saved")


def commands():
    blocks = re.findall(r"^```sh\n(.*?)^```", README.read_text(), flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"\\\n *", "", "".join(blocks)).splitlines()


def container_name(printed):
    return f"{printed}-readme-{os.getpid()}"


def isolated(line, port):
    """The command with the given port and unique container names."""
    line = line.replace(PUBLISHED, f"127.0.0.1:{port}")
    names = "|".join(CONTAINERS)
    return re.sub(rf"(?<= )({names})(?= |$)", lambda name: container_name(name.group()), line)


@pytest.fixture(scope="module")
def port():
    """A free port of the host."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module", autouse=True)
def removed_containers():
    yield
    run("docker", "rm", "--force", *map(container_name, CONTAINERS))


def test_commands_are_isolated():
    line = isolated("docker run --detach --name grasp --publish 127.0.0.1:50051:50051 grasp-server", 4711)
    assert line == f"docker run --detach --name {container_name('grasp')} --publish 127.0.0.1:4711:50051 grasp-server"
    line = isolated("docker stop grasp-objects", 4711)
    assert line == f"docker stop {container_name('grasp-objects')}"


@pytest.mark.parametrize("line", commands())
def test_command(line, port):
    line = isolated(line, port)
    if line.startswith("docker compose") and not os.environ.get("GRASP_COMPOSE"):
        skip("docker/README.md's compose commands: there is no compose")
    if "--memory" in line and not limits_memory():
        print("docker/README.md's memory limits are left out: the engine cannot set them here")
        line = re.sub(r" --memory \S+", "", line)
    deadline = time.monotonic() + HANGS_AFTER
    done = run("bash", "-c", line, cwd=ROOT)
    # The service may still be starting; a person types more slowly.
    while done.returncode != 0 and "--health-check" in line and time.monotonic() < deadline:
        time.sleep(0.1)
        done = run("bash", "-c", line, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_page_shows_the_essential_commands():
    printed = "\n".join(commands())
    for part in ("docker build ", "docker run ", "docker exec ", "docker stop ", "docker compose ", "/objects:ro"):
        assert part in printed


def test_linked_files_exist():
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", README.read_text()):
        assert (README.parent / pathlib.PurePosixPath(target)).exists(), target


def test_default_memory_matches_the_page():
    """The page's figures, by the page's formula, from the configuration in force."""
    printed = run("docker", "run", "--rm", "grasp-server", "--print-config").stdout
    value = {key: int(text) for key, text in re.findall(r"^(\w+) = (\d+)$", printed, flags=re.MULTILINE)}
    in_memory = (
        value["cache_bytes"]
        + value["maximum_uploads"] * value["maximum_object_bytes"]
        + value["maximum_upload_bytes"] * 3 // 2
        + value["maximum_unread_bytes"]
    )
    saved = in_memory + max(value["maximum_object_bytes"], value["maximum_upload_bytes"])
    documented = re.search(r"by default (\d+) MiB, or (\d+) MiB if objects are saved", README.read_text()).groups()
    assert [in_memory / 2**20, saved / 2**20] == [float(figure) for figure in documented]
