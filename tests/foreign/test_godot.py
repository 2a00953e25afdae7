"""The add-on for Godot in a running Godot: its cases are in tests/foreign/godot, one script each."""

import os
import re
import shutil
import subprocess

import pytest

from conftest import ROOT

GODOT = ROOT / "target/foreign/godot/godot"
CASES = ROOT / "tests/foreign/godot"
README = ROOT / "client/godot/README.md"

pytestmark = pytest.mark.skipif(not GODOT.exists(), reason="there is no Godot, and it cannot be installed")


def run(command, home):
    """Runs Godot, with settings and caches in a folder of its own; returns all that it wrote."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("XDG_")}
    done = subprocess.run(
        [str(part) for part in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=100,
        env={**environment, "HOME": str(home)},
    )
    print(done.stdout)
    assert done.returncode == 0 and "SCRIPT ERROR" not in done.stdout
    return done.stdout


def import_project(project):
    """Does what opening a project in the editor does: scripts are registered, files imported."""
    (project / "tests").mkdir()
    for case in CASES.glob("*.gd"):
        shutil.copy(case, project / "tests")
    shutil.copy(ROOT / "assets/objects/scissors.obj", project / "tests")
    run([GODOT, "--headless", "--path", project, "--import"], project.parent)


def run_case(project, address, name, *arguments, prefix=(), options=("--headless",)):
    script = f"res://tests/case_{name}.gd"
    url = f"http://{address}"
    command = [*prefix, GODOT, *options, "--path", project, "--script", script, "--", url, ROOT, *arguments]
    output = run(command, project.parent)
    assert "PASSED" in output.splitlines()


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A copy of client/godot, with the cases."""
    root = tmp_path_factory.mktemp("godot")
    copy = root / "client/godot"
    shutil.copytree(ROOT / "client/godot", copy, ignore=shutil.ignore_patterns(".godot"))
    (root / "assets").symlink_to(ROOT / "assets")
    import_project(copy)
    return copy


@pytest.mark.parametrize("name", ["golden", "ask", "skeletons", "player", "track", "import", "errors"])
def test_case(project, address, name):
    run_case(project, address, name)


def test_sample_shows_both_hands_and_the_object(project, address, tmp_path):
    if not shutil.which("xvfb-run"):
        pytest.skip("there is no Xvfb, and it cannot be installed")
    prefix = ["xvfb-run", "--auto-servernum", "--server-args", "-screen 0 1280x720x24"]
    options = ["--rendering-driver", "opengl3", "--audio-driver", "Dummy", "--resolution", "640x360"]
    run_case(project, address, "picture", tmp_path, prefix=prefix, options=options)


def test_readme_leads_to_a_posed_hand(address, tmp_path):
    """A clean project, the README's commands, its script of at most 15 lines, and the rest of its code."""
    blocks = re.findall(r"```(\w+)\n(.*?)```", README.read_text(), re.DOTALL)
    commands = next(text for language, text in blocks if language == "sh")
    scripts = [text for language, text in blocks if language == "gdscript"]
    assert len(scripts[0].splitlines()) <= 15
    project = tmp_path / "my-game"
    project.mkdir()
    (project / "project.godot").write_text('config_version=5\n[application]\nconfig/features=PackedStringArray("4.6")\n')
    subprocess.run(["bash", "-ec", commands], cwd=ROOT, env={**os.environ, "HOME": str(tmp_path)}, check=True)
    of_this_server = f'\\g<0>\tclient.url = "http://{address}"\n'
    scripts[0] = re.sub(r"\tvar client := GraspClient.new\(\)\n", of_this_server, scripts[0])
    (project / "readme.gd").write_text("\n".join(scripts))
    import_project(project)
    run_case(project, address, "readme")
