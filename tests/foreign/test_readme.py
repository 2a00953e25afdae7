"""Every command of the README runs as it is printed there.

A ```sh block is run line by line. Three kinds of line are treated specially: the server is started in the background
and stopped at the end, `grpcurl` is replaced by the equal `buf curl` call (grpcurl is in no package registry), and
`tests/run` is the run that this test is part of.
"""

import itertools
import pathlib
import re
import shlex
import signal
import subprocess
import time

import pytest
from conftest import ROOT

SERVER = "http://[::1]:50051"
# Where the README's experiments leave their runs.
EXPERIMENT = ROOT / "target/experiment"


def commands():
    """The lines of the README's sh blocks, continuation lines joined."""
    text = (ROOT / "README.md").read_text()
    blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if line.strip() and not line.strip().startswith("#")]


def as_buf_curl(line):
    """`grpcurl -plaintext [-d DATA] HOST:PORT [METHOD|list]` as the arguments of the equal `buf curl`."""
    words = shlex.split(line)
    assert words[:2] == ["grpcurl", "-plaintext"], f"cannot translate {line}"
    data = words[words.index("-d") + 1] if "-d" in words else None
    address, method = words[-2:]
    common = ["buf", "curl", "--protocol", "grpc", "--http2-prior-knowledge"]
    if method == "list":
        return [*common, "--list-services", f"http://{address}"]
    return [*common, *(["-d", data] if data else []), f"http://{address}/{method}"]


@pytest.fixture(scope="module")
def no_earlier_experiment():
    """Experiments start afresh, as a new user's do: a run that another state of the search has made is refused.

    It may have taken hours, so it is put aside under a name that is free.
    """
    if EXPERIMENT.exists():
        aside = (EXPERIMENT.with_name(f"experiment-before-tests-{number}") for number in itertools.count(1))
        EXPERIMENT.rename(next(place for place in aside if not place.exists()))


@pytest.fixture(scope="module")
def server():
    """The server as the README starts it, on its default address."""
    process = subprocess.Popen([ROOT / "target/release/grasp-server"], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 20
    while subprocess.run([ROOT / "target/release/grasp", "health"], capture_output=True).returncode != 0:
        assert process.poll() is None, "the server ended at once"
        assert time.monotonic() < deadline, "the server did not become healthy"
        time.sleep(0.05)
    yield
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=10) == 0


def test_the_readme_shows_the_two_commands_and_a_call():
    lines = commands()
    assert "cargo run --release -- demo" in lines
    assert "tests/run" in lines
    assert any(line.startswith("grpcurl ") for line in lines)
    assert any(line == "cargo run --release -p grasp-server" for line in lines)


@pytest.mark.parametrize("line", commands())
def test_command(line, server, no_earlier_experiment):
    if line == "tests/run" or line == "cargo run --release -p grasp-server":
        return  # The one is running now; the other is the fixture.
    arguments = as_buf_curl(line) if line.startswith("grpcurl ") else ["bash", "-c", line]
    run = subprocess.run(arguments, cwd=ROOT, capture_output=True, text=True, timeout=540)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.strip() or "--out" in line, "the command printed nothing"


def test_every_linked_file_is_there():
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", (ROOT / "README.md").read_text()):
        assert (ROOT / pathlib.PurePosixPath(target)).exists(), target
