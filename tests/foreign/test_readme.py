"""Runs every command of the README and of the pages behind it as printed, except for the server's port, and checks their links and the
server's configuration on its page.

Each line of a ```sh block is one test; so is a block as a whole whose lines need each other, which start something in the
background or set a variable. The line that starts the server is the fixture, and `tests/run` is the run that this test is part of. `grpcurl`
is that of bin/, which calls `buf curl`. Calls go to a free port instead of the default one, where another server may be
listening.
"""

import os
import re
import shlex
import socket
import subprocess

import pytest

from conftest import ROOT, start_server, stop_server

DEFAULT_HOST, DEFAULT_PORT = "::1", 50051
PAGES = ["README.md", "proto/CALLS.md", "proto/ERRORS.md", "client/README.md", "server/HANDS.md"]
START_SERVER = "cargo run --release -p grasp-server"
# Exit code of grpcurl at a call's deadline.
DEADLINE_EXCEEDED = 64 + 4
# Commands that take long and seldom break; they run with GRASP_TEST_CASES=all.
LONG = ("-- bake ",)


def commands_of(block):
    """A block's commands: its lines with those that they continue on, or the whole block if it needs one shell."""
    if re.search(r" &$|^\w+=", block, flags=re.MULTILINE):
        return [block]
    commands, begun = [], ""
    for line in re.sub(r"\\\n|(?<=\|)\n", " ", block).splitlines():
        if begun or (line.strip() and not line.strip().startswith("#")):
            begun = f"{begun}\n{line}".strip()
            if is_whole(begun):
                commands.append(begun)
                begun = ""
    return commands


def is_whole(command):
    """Whether all quotes of a command are closed."""
    try:
        shlex.split(command)
    except ValueError:
        return False
    return True


# Parts of the README that open: first calls in other languages, which the tests of the clients run.
OPENED = re.compile(r"<details>.*?</details>", flags=re.DOTALL)


def commands():
    """The commands of the pages' sh blocks."""
    text = OPENED.sub("", "\n".join((ROOT / page).read_text() for page in PAGES))
    blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    return [command for block in blocks for command in commands_of(block)]


def with_address(command, host_port):
    """The command with the default address replaced."""
    replaced = command.replace(f"[{DEFAULT_HOST}]:{DEFAULT_PORT}", host_port)
    assert str(DEFAULT_PORT) not in replaced, f"{command} names the default port in a form that this test does not know"
    return replaced


def calls_without_streams_to_the_server():
    """SERVICE/METHOD of every unary and server-streaming call of the contract."""
    for file in (ROOT / "proto/grasp/v1").glob("*_service.proto"):
        text = file.read_text()
        service = re.search(r"^service (\w+)", text, flags=re.MULTILINE).group(1)
        for method, request in re.findall(r"^ *rpc (\w+)\(([^)]*)\)", text, flags=re.MULTILINE):
            if not request.startswith("stream "):
                yield f"grasp.v1.{service}/{method}"


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


def test_readme_shows_the_two_commands_and_the_server():
    assert {"cargo run --release -- demo", "tests/run", START_SERVER} <= set(commands())


def test_pages_show_grpcurl_for_every_call_without_a_stream_to_the_server():
    shown = {call for command in commands() for call in re.findall(r"grpcurl .*?(grasp\.v1\.\w+/\w+)", command, re.DOTALL)}
    wanted = set(calls_without_streams_to_the_server())
    assert {"grasp.v1.GraspService/CreateTrack", "grasp.v1.ObjectService/GetMesh"} <= wanted
    assert shown == wanted


@pytest.mark.parametrize("command", commands())
def test_command(command, server):
    if command in ("tests/run", START_SERVER):
        return
    if any(long in command for long in LONG) and os.environ.get("GRASP_TEST_CASES") != "all":
        pytest.skip("it takes long")
    path = os.pathsep.join([str(ROOT / "tests/foreign/bin"), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "GRASP_SERVER": f"http://{server}"}
    arguments = ["bash", "-c", with_address(command, server)]
    run = subprocess.run(arguments, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=540)
    said = run.stdout + run.stderr
    if "-max-time" in command:
        # Such calls end at their deadline only; a shell's exit code is not that of its background jobs.
        assert "deadline_exceeded" in run.stderr, said
        assert run.returncode == (0 if " &\n" in command else DEADLINE_EXCEEDED), said
    else:
        assert run.returncode == 0, said
    assert run.stdout.strip() or "--out" in command, "the command printed nothing"


def test_files_that_contributing_names_exist():
    text = (ROOT / ".github/CONTRIBUTING.md").read_text()
    named = [name for name in re.findall(r"`([\w.-]+/[\w./-]+)`", text) if not name.startswith("target/")]
    assert "server/synthesis" in named
    for name in named:
        assert (ROOT / name).exists(), name


def test_first_calls_are_those_of_the_clients_pages():
    pages = [(ROOT / "client" / name / "README.md").read_text() for name in ("python", "web", "godot", "unity")]
    blocks = [
        block
        for part in OPENED.findall((ROOT / "README.md").read_text())
        for block in re.findall(r"^```(?!rust)\w+\n.*?^```$", part, flags=re.MULTILINE | re.DOTALL)
    ]
    assert len(blocks) >= 7
    for block in blocks:
        assert any(block in page for page in pages), block


def test_the_page_of_errors_lists_every_reason_once():
    reasons = re.findall(r"ERROR_REASON_(\w+) = [1-9]", (ROOT / "proto/grasp/v1/error_reason.proto").read_text())
    rows = re.findall(r"^\| (`.*?) \| `\w+` \|", (ROOT / "proto/ERRORS.md").read_text(), flags=re.MULTILINE)
    assert sorted(reason for row in rows for reason in re.findall(r"`(\w+)`", row)) == sorted(reasons)


SERVER_PAGE = ROOT / "server/README.md"
LINKED = [
    "README.md",
    "proto/README.md",
    "proto/CALLS.md",
    "proto/ERRORS.md",
    "proto/LIMITS.md",
    "proto/PACKED.md",
    "client/README.md",
    "client/RECIPES.md",
    "client/bevy/README.md",
    "server/README.md",
    "server/HANDS.md",
    "server/OPERATIONS.md",
    "docker/README.md",
    "tests/README.md",
    "tests/results/measured-once.md",
    "tests/quality/README.md",
    "tests/quality/everyday/README.md",
]


@pytest.mark.parametrize("page", LINKED)
def test_every_linked_file_exists(page):
    file = ROOT / page
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", file.read_text()):
        assert (file.parent / target).exists(), target


def test_the_server_page_lists_exactly_the_keys_of_the_configuration():
    help_text = subprocess.run(
        [ROOT / "target/release/grasp-server", "--help"], capture_output=True, text=True, check=True, timeout=20
    ).stdout
    variables = set(re.findall(r"\[env: GRASP_(\w+)=", help_text)) - {"CONFIG"}
    listed = re.findall(r"^\| `(\w+)` \|", SERVER_PAGE.read_text(), flags=re.MULTILINE)
    assert variables
    assert sorted(listed) == sorted(name.lower() for name in variables)


def printed(value):
    """A default of the page as `--print-config` prints it."""
    number, _, unit = value.replace(",", "").partition(" ")
    return str(int(number) << 20) if unit == "MiB" else number


def test_the_server_page_has_the_defaults_in_force():
    config = subprocess.run(
        [ROOT / "target/release/grasp-server", "--print-config"], capture_output=True, text=True, check=True, timeout=20
    ).stdout
    in_force = dict(re.findall(r"^(\w+) = \"?([^\"\n]*)\"?$", config, flags=re.MULTILINE))
    rows = re.findall(r"^\| `(\w+)` \| `?([^`|]+?)`? \|", SERVER_PAGE.read_text(), flags=re.MULTILINE)
    # The numbers of threads depend on the machine, the store on the user, and other folders have no default.
    of_the_machine = ("workers", "io_threads", "store")
    listed = {key: value for key, value in rows if key not in of_the_machine and value != "none"}
    assert len(listed) > 10
    for key, value in listed.items():
        assert in_force[key] == printed(value), key
