"""Every command of docker/README.md runs as it is printed there, in its order.

`docker` is the engine under test, and builds get the build image that could be had; see tests/container/run.
"""

import os
import pathlib
import re
import time

import pytest
from conftest import HANGS_AFTER, ROOT, limits_memory, run, skip

README = ROOT / "docker" / "README.md"

# Names of the containers that the commands start.
CONTAINERS = ("grasp", "grasp-objects")


def commands():
    blocks = re.findall(r"^```sh\n(.*?)^```", README.read_text(), flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"\\\n *", "", "".join(blocks)).splitlines()


@pytest.fixture(scope="module", autouse=True)
def no_remains():
    run("docker", "rm", "--force", *CONTAINERS)
    yield
    run("docker", "rm", "--force", *CONTAINERS)


@pytest.mark.parametrize("line", commands())
def test_command(line):
    if line.startswith("docker compose") and not os.environ.get("GRASP_COMPOSE"):
        skip("docker/README.md's compose commands: there is no compose")
    if "--memory" in line and not limits_memory():
        print("docker/README.md's memory limits are left out: the engine cannot set them here")
        line = re.sub(r" --memory \S+", "", line)
    deadline = time.monotonic() + HANGS_AFTER
    done = run("bash", "-c", line, cwd=ROOT)
    # A person is slower than the start of the service.
    while done.returncode != 0 and "--health-check" in line and time.monotonic() < deadline:
        time.sleep(0.1)
        done = run("bash", "-c", line, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_commands_are_those_that_the_page_is_about():
    printed = "\n".join(commands())
    for part in ("docker build ", "docker run ", "docker exec ", "docker stop ", "docker compose ", "/objects:ro"):
        assert part in printed


def test_every_linked_file_is_there():
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", README.read_text()):
        assert (README.parent / pathlib.PurePosixPath(target)).exists(), target


def test_the_sum_of_the_default_memory_is_the_server_s():
    """The figure of the page, by the formula of the page, from the configuration in force."""
    printed = run("docker", "run", "--rm", "--env", "GRASP_WORKERS=30", "grasp-server", "--print-config").stdout
    value = {key: int(text) for key, text in re.findall(r"^(\w+) = (\d+)$", printed, flags=re.MULTILINE)}
    mib = 1 << 20
    upload = 2 * value["maximum_object_bytes"] + 640 * value["maximum_object_triangles"] + 512 * 1024
    total = (
        20 * mib
        + value["cache_bytes"]
        + value["maximum_uploads"] * upload
        + 20 * mib * value["builder_threads"]
        + 2 * mib * value["maximum_searches"]
        + 32 * 1024 * value["maximum_connections"]
        + 64 * 1024 * (30 + value["io_threads"])
    )
    told = int(re.search(r"by default (\d+) MiB", README.read_text()).group(1))
    assert abs(total / mib - told) < 3
