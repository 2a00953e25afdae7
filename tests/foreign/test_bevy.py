"""Runs the example of client/bevy without a window, which compiles an engine: only with GRASP_TEST_CASES=all."""

import os
import re
import subprocess

import pytest

from conftest import ROOT

README = (ROOT / "client/bevy/README.md").read_text()


@pytest.mark.skipif(os.environ.get("GRASP_TEST_CASES") != "all", reason="Bevy: it compiles for minutes")
def test_a_model_is_posed_as_the_answer_says(address):
    (command,) = re.findall(r"^```sh\n(.*?)\n```", README, flags=re.MULTILINE | re.DOTALL)
    command = command.replace("[::1]:50051", address)
    environment = {**os.environ, "CARGO_TARGET_DIR": str(ROOT / "target/bevy")}
    fetch = ["cargo", "fetch", "--locked", "--manifest-path", "client/bevy/Cargo.toml"]
    if subprocess.run(fetch, cwd=ROOT, capture_output=True, check=False).returncode != 0:
        pytest.skip("Bevy: its crates cannot be fetched")
    arguments = ["bash", "-c", command.replace("cargo run", "cargo run --locked")]
    ran = subprocess.run(arguments, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=1800)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    distances = re.findall(r"^(\S+): ([\d.]+) mm", ran.stdout, flags=re.MULTILINE)
    assert len(distances) == 19 and all(float(distance) <= 1 for _, distance in distances), ran.stdout
    assert " touches the object " in ran.stdout
