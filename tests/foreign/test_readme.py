"""Runs every command of the README as printed, except for the server's port.

Each line of a ```sh block is one test. The line that starts the server is the fixture, `tests/run` is the run that this
test is part of, and `grpcurl`, which is in no package registry, becomes the equivalent `buf curl` call. Calls go to a
free port instead of the default one, where another server may be listening.
"""

import itertools
import os
import pathlib
import re
import shlex
import socket
import subprocess

import pytest
from conftest import ROOT, start_server, stop_server

DEFAULT_HOST, DEFAULT_PORT = "::1", 50051
START_SERVER = "cargo run --release -p grasp-server"
# Where the README's experiments write their runs.
EXPERIMENT = ROOT / "target/experiment"


def commands():
    """The lines of the README's sh blocks, with continuation lines joined."""
    text = (ROOT / "README.md").read_text()
    blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if line.strip() and not line.strip().startswith("#")]


def with_address(line, host_port):
    """The command with the default address replaced."""
    replaced = line.replace(f"[{DEFAULT_HOST}]:{DEFAULT_PORT}", host_port)
    assert str(DEFAULT_PORT) not in replaced, f"{line} names the default port in a form that this test does not know"
    return replaced


def as_buf_curl(line):
    """The arguments of the `buf curl` call for `grpcurl -plaintext [-d DATA] HOST:PORT [METHOD|list]`."""
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
    """Moves an earlier experiment out of the way, because the command refuses to resume the run of another build.

    It may have taken hours, so it is kept under a free name.
    """
    if EXPERIMENT.exists():
        aside = (EXPERIMENT.with_name(f"experiment-before-tests-{number}") for number in itertools.count(1))
        EXPERIMENT.rename(next(place for place in aside if not place.exists()))


@pytest.fixture(scope="module")
def default_port_is_occupied():
    """Listens on the default port, unless something else does, and checks that no command connected to it."""
    with socket.socket(socket.AF_INET6) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((DEFAULT_HOST, DEFAULT_PORT))
        except OSError:
            yield
            return
        listener.listen()
        listener.setblocking(False)
        yield
        with pytest.raises(BlockingIOError):
            listener.accept()


@pytest.fixture(scope="module")
def server(default_port_is_occupied):
    """A server as the README starts it, but on a free port; its host:port."""
    process, host_port = start_server("--listen", f"[{DEFAULT_HOST}]:0")
    yield host_port
    stop_server(process)


def test_readme_shows_the_two_commands_the_server_and_a_call():
    lines = commands()
    assert {"cargo run --release -- demo", "tests/run", START_SERVER} <= set(lines)
    assert any(line.startswith("grpcurl ") for line in lines)


@pytest.mark.parametrize("line", commands())
def test_command(line, server, no_earlier_experiment):
    if line in ("tests/run", START_SERVER):
        return
    line = with_address(line, server)
    arguments = as_buf_curl(line) if line.startswith("grpcurl ") else ["bash", "-c", line]
    environment = {**os.environ, "GRASP_SERVER": f"http://{server}"}
    run = subprocess.run(arguments, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=540)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.strip() or "--out" in line, "the command printed nothing"


def test_linked_files_exist():
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", (ROOT / "README.md").read_text()):
        assert (ROOT / pathlib.PurePosixPath(target)).exists(), target
