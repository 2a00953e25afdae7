"""Builds the Python package, installs it as its README says, and checks it: README, calls, golden grasps, types and the sample."""

import os
import re
import shutil
import subprocess

import pytest

from conftest import ROOT

WORK = ROOT / "target/foreign/python"
PACKAGE = ROOT / "client/python"
CHECKS = ROOT / "tests/foreign/python"
#: The server of the README.
SERVER = "localhost:50051"
STRICT = ["--strict", "--cache-dir", WORK / "mypy", "--config-file", PACKAGE / "pyproject.toml"]
# pip and build take packages from there alone.
ENVIRONMENT = {
    **{name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")},
    "PIP_NO_INDEX": "1",
    "PIP_FIND_LINKS": str(WORK / "wheels"),
    "PIP_DISABLE_PIP_VERSION_CHECK": "1",
    "PIP_NO_COMPILE": "1",
    "PYTHONDONTWRITEBYTECODE": "1",
}


def run(*command, cwd=ROOT, **environment):
    """Runs a command; returns its output."""
    done = subprocess.run(
        list(map(str, command)),
        cwd=cwd,
        env={**ENVIRONMENT, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=240,
    )
    assert done.returncode == 0, f"{command} ended with {done.returncode}:\n{done.stdout}"
    return done.stdout


def blocks(language):
    """The README's code blocks."""
    return re.findall(rf"^```{language}\n(.*?)^```", (PACKAGE / "README.md").read_text(), re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def venv():
    """A virtual environment with the package, built from its source distribution, and the tools that check it."""
    if not (WORK / "wheels.txt").exists():
        pytest.skip("the packages for it are not installed: see tests/foreign/install/python.sh")
    python = WORK / "venv/bin/python"
    shutil.rmtree(WORK / "dist", ignore_errors=True)
    # The wheel is built from the source distribution.
    run(python, "-m", "build", "--no-isolation", "--outdir", WORK / "dist", PACKAGE)
    (wheel,) = (WORK / "dist").glob("*.whl")
    run(python, "-m", "pip", "install", "--quiet", "--no-deps", "--force-reinstall", wheel)
    return WORK / "venv/bin"


@pytest.fixture(scope="module")
def fresh(venv):
    """A folder with nothing but the checkout, in which the README's first block was run."""
    folder = WORK / "fresh"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for part in ("assets", "client", "proto"):
        (folder / part).symlink_to(ROOT / part)
    run("bash", "-euc", blocks("sh")[0], cwd=folder)
    return folder


def test_readme_leads_from_a_clean_folder_to_a_posed_hand(venv, fresh, address):
    assert len(blocks("sh")[0].splitlines()) + len(blocks("python")[0].splitlines()) <= 15
    script = fresh / "readme.py"
    script.write_text("".join(blocks("python")).replace(SERVER, address))
    printed = run(fresh / "venv/bin/python", script, cwd=fresh)
    assert re.search(r"a (left|right) hand, \w+, wrist at \[", printed)
    assert "(26, 3) (26, 4)" in printed and "100%" in printed and "search.budget" in printed
    run(venv / "mypy", *STRICT, script)


def test_the_sample_shows_a_handover(fresh, address):
    printed = run("bash", "-euc", blocks("sh")[1].replace(SERVER, f"{address} --once --port 0"), cwd=fresh)
    assert re.search(r"\*\*\w+\*\*, score 0\.\d\d on http://localhost:\d+", printed)


@pytest.mark.parametrize("checks", ["check_golden.py", "check_client.py"])
def test_the_package(venv, address, checks):
    run(venv / "pytest", "-q", "-p", "no:cacheprovider", "--confcutdir", CHECKS, CHECKS / checks, GRASP_ADDRESS=address)


def test_the_package_and_its_sample_are_typed(venv):
    run(venv / "mypy", *STRICT, "-p", "grasp")
    run(venv / "mypy", *STRICT, PACKAGE / "examples/show.py")
