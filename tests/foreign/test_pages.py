"""The README and the pages behind it: their links lead somewhere, and the server's page has every key of its configuration."""

import re
import subprocess

import pytest
from conftest import ROOT

SERVER_PAGE = ROOT / "server/README.md"
PAGES = [
    "README.md",
    "proto/README.md",
    "proto/CALLS.md",
    "client/README.md",
    "server/README.md",
    "server/HANDS.md",
    "docker/README.md",
    "tests/README.md",
    "tests/results/measured-once.md",
    "tests/quality/README.md",
    "tests/quality/everyday/README.md",
]


@pytest.mark.parametrize("page", PAGES)
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
