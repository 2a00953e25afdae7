"""The page that the server serves with --viewer: it is used in a headless Chromium as a person does."""

import gzip
import json
import os
import re
import shutil
import signal
import subprocess
import urllib.error
import urllib.request

import pytest
from conftest import ROOT, start_server, stop_server

SOURCES = ROOT / "client/web/viewer"
PACKAGES = ROOT / "target/foreign/viewer/node_modules"
# Longest time for all that is done in the page, in seconds.
LONGEST = 240

LARGEST_PAGE = 1_200_000
MOST_DRAW_CALLS = 200
MOST_TRIANGLES = 300_000

needs_packages = pytest.mark.skipif(not (PACKAGES / "puppeteer-core").is_dir(), reason="the viewer's packages are not installed")


@pytest.fixture(scope="module")
def server():
    process, address = start_server("--listen", "127.0.0.1:0", "--viewer")
    yield f"http://{address}"
    stop_server(process)


def get(url, **headers):
    return urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=20)


def test_the_page_is_served_packed_and_only_to_those_who_need_it(server):
    with get(server, **{"accept-encoding": "gzip"}) as answer:
        page = answer.read()
        assert answer.headers["content-encoding"] == "gzip"
        assert answer.headers["content-type"] == "text/html; charset=utf-8"
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert "connect-src 'self'" in answer.headers["content-security-policy"]
        etag = answer.headers["etag"]
    assert len(page) <= LARGEST_PAGE
    assert gzip.decompress(page).startswith(b"<!doctype html>")
    with pytest.raises(urllib.error.HTTPError) as unchanged:
        get(server, **{"if-none-match": etag})
    assert unchanged.value.code == 304


def test_a_server_without_the_option_has_no_page(address):
    with pytest.raises(urllib.error.HTTPError) as refused:
        get(f"http://{address}/")
    assert refused.value.code == 405


def test_the_command_line_serves_the_page_until_it_is_interrupted():
    process = subprocess.Popen([ROOT / "target/release/grasp", "view", "--no-open"], stdout=subprocess.PIPE, text=True)
    url = re.search(r"http://\S+/", process.stdout.readline()).group(0)
    with get(url) as answer:
        assert answer.read().startswith(b"<!doctype html>")
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=20) == 130


@needs_packages
def test_the_committed_page_is_what_its_sources_give():
    environment = {**os.environ, "NODE_PATH": str(PACKAGES)}
    run = subprocess.run(["node", SOURCES / "build.mjs", "--check"], env=environment, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.fixture(scope="module")
def seen(server, tmp_path_factory):
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("there is no Chromium")
    folder = ROOT / "target/foreign/viewer/seen"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    shutil.copy(ROOT / "tests/container/objects/block.obj", folder / "block.obj")
    shutil.copy(ROOT / "assets/hands/adult_right.glb", folder / "hand.glb")
    motion = subprocess.run(
        [ROOT / "target/release/grasp", "track", "--holdout", "scissors-hold1", "--moving", "turn", "--length", "1s", "--print-motion"],
        capture_output=True,
        check=True,
        timeout=60,
    )
    (folder / "motion.json").write_bytes(motion.stdout)
    run = subprocess.run(
        ["node", ROOT / "tests/foreign/viewer/drive.mjs", server, chromium, folder],
        env={**os.environ, "NODE_PATH": str(PACKAGES)},
        capture_output=True,
        text=True,
        timeout=LONGEST,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    found = json.loads(run.stdout)
    print(f"first grasp after {found['first']['ms']:.0f} ms, {found['frameMs']:.0f} ms a frame, {found['first']['calls']} draw calls")
    return found


@needs_packages
def test_shows_a_grasp_within_bounds(seen):
    first = seen["first"]
    assert first["outcome"] == "Found"
    assert re.fullmatch(r"[\d.]+ ms", first["time"])
    assert first["type"] and first["contacts"] >= 2
    assert 0 < first["calls"] <= MOST_DRAW_CALLS
    assert 10_000 < first["triangles"] <= MOST_TRIANGLES


@needs_packages
def test_calls_nothing_but_its_server_and_logs_no_error(seen, server):
    assert seen["problems"] == []
    assert set(seen["requested"]) <= {server, "blob:", "null"}


@needs_packages
def test_poses_hands_as_the_server_does(seen):
    assert seen["jointsOff"] < 1e-4


@needs_packages
def test_the_hand_touches_the_object_on_the_screen(seen):
    touch = seen["touch"]
    assert touch["beside"] > 50
    assert all(touch["touching"]), touch


@needs_packages
def test_the_grasp_follows_the_mouse_and_undo_takes_it_back(seen):
    drag = seen["drag"]
    moved = [b - a for a, b in zip(drag["start"], drag["end"])]
    assert moved[1] > 0.005 and abs(moved[0]) < 1e-6 and abs(moved[2]) < 1e-6, moved
    assert drag["status"] in {"Kept", "Adjusted", "Replanned", "None"}
    assert seen["undone"] == pytest.approx(drag["start"], abs=1e-6)
    assert seen["linked"] == pytest.approx(drag["end"], abs=1e-4)
    assert seen["fingers"]["open"] == pytest.approx(0.2, abs=0.011)
    assert seen["fingers"]["status"] in {"Kept", "Adjusted", "Replanned", "None"}


@needs_packages
def test_compares_two_versions(seen):
    before, after, again = seen["compare"]
    assert before == again and before[1] and after[1]
    assert after[0] == pytest.approx(0.2, abs=0.011) and abs(before[0] - after[0]) > 0.005


@needs_packages
def test_copies_the_request_as_code_that_runs(seen, tmp_path):
    environment = {**os.environ, "PATH": f"{ROOT / 'tests/foreign/bin'}:{ROOT / 'target/foreign/node_modules/.bin'}:{os.environ['PATH']}"}
    run = subprocess.run(["bash", "-c", seen["code"]["grpcurl"]], env=environment, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["outcome"] in {"OUTCOME_FOUND", "OUTCOME_BUDGET_EXHAUSTED"}
    run = subprocess.run(["bash", "-c", seen["code"]["curl"]], capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["outcome"] in {"OUTCOME_FOUND", "OUTCOME_BUDGET_EXHAUSTED"}
    python = tmp_path / "snippet.py"
    python.write_text(seen["code"]["python"])
    environment["PYTHONPATH"] = str(ROOT / "target/foreign")
    run = subprocess.run([ROOT / "target/foreign/venv/bin/python", python], env=environment, capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    assert "GraspClient::connect" in seen["code"]["rust"]


@needs_packages
def test_downloads_the_scene_and_the_grasp(seen):
    assert seen["scene"]["magic"] == "glTF"
    assert {"object", "giver", "receiver", "giver-skin", "receiver-skin"} <= set(seen["scene"]["names"])
    lines = seen["isaac"].splitlines()
    assert lines[:2] == ["format: isaac_grasp", "format_version: 1.0"]
    # As the command line reads it.
    assert any(re.fullmatch(r"gripper_frame: rigs/adult/(left|right)", line) for line in lines)
    orientation = next(line for line in lines if "orientation:" in line)
    w, x, y, z = (float(value) for value in re.findall(r"-?\d+\.\d+", orientation))
    assert w * w + x * x + y * y + z * z == pytest.approx(1, abs=1e-4)
    assert sum("thumb_base_yaw" in line for line in lines) == 2


@needs_packages
def test_lists_grips_and_keeps_those_that_are_preferred(seen):
    grips = seen["grips"]
    assert 2 <= grips["count"] == grips["pictures"]
    assert grips["object"]["name"] == "objects/remote-own"
    assert not grips["object"]["builtIn"] and grips["object"]["preference"] == 1


@needs_packages
def test_a_dropped_object_is_grasped_and_painted(seen):
    assert seen["dropped"]["object"] == "objects/block"
    assert "triangles" in seen["dropped"]["report"] and "unit" in seen["dropped"]["report"]
    scrub = seen["scrub"]
    assert max(abs(a - b) for a, b in zip(scrub["closed"], scrub["back"])) > 0.02
    assert scrub["end"] == pytest.approx(scrub["closed"], abs=1e-6)
    assert seen["painted"]["forbidden"] > 0


@needs_packages
def test_a_dropped_hand_is_posed_as_the_answer_says(seen):
    assert seen["hand"]["isShown"]
    assert max(seen["hand"]["tips"]) < 0.004, seen["hand"]


@needs_packages
def test_a_recording_is_played(seen):
    assert seen["recording"]["object"] == "objects/scissors"
    assert seen["recording"]["status"] in {"Kept", "Adjusted", "Replanned", "None"}


@needs_packages
def test_a_tracked_hand_holds_the_object_out(seen):
    xr = seen["xr"]
    # The user faces +Z: the hand's right is the page's -x.
    assert xr["there"][0] - xr["moved"][0] == pytest.approx(0.1, abs=0.02), xr
    assert xr["status"] in {"Kept", "Adjusted", "Replanned", "None"}
