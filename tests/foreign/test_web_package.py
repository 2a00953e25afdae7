"""The web client: its build and unit tests, its README in Node, and its sample pages in a headless Chromium, with emulated hands."""

import base64
import http.server
import json
import math
import os
import pathlib
import queue
import re
import shutil
import subprocess
import tempfile
import threading

import pytest
from conftest import ROOT

SOURCES = ROOT / "client/web"
WORK = ROOT / "target/foreign/web_package"
PACKAGE = WORK / "client/web"
PICTURES = WORK / "pictures"
LONGEST = 120
JOINTS = [
    "palm",
    "wrist",
    *[f"thumb-{joint}" for joint in ["metacarpal", "phalanx-proximal", "phalanx-distal", "tip"]],
    *[
        f"{finger}-finger-{joint}"
        for finger in ["index", "middle", "ring", "pinky"]
        for joint in ["metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"]
    ],
]


def run(command, folder=PACKAGE, **more):
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=LONGEST, **more)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def package():
    """A copy of the package that is built."""
    if not (PACKAGE / "installed.json").exists():
        pytest.skip("the web client's packages are not installed")
    ignored = shutil.ignore_patterns("node_modules", "dist", "gen", "viewer", "package-lock.json")
    for folder in ["src", "test", "examples"]:
        shutil.rmtree(PACKAGE / folder, ignore_errors=True)
    shutil.copytree(SOURCES, PACKAGE, dirs_exist_ok=True, ignore=ignored)
    for shared in ["proto", "assets"]:
        if not (WORK / shared).exists():
            (WORK / shared).symlink_to(ROOT / shared)
    PICTURES.mkdir(exist_ok=True)
    run(["npm", "run", "build"])
    return PACKAGE


def test_unit_tests_pass(package):
    run(["npm", "test"])


def readme_block(language, heading, address):
    """The first code block of a language under a heading of the README, for the server at an address."""
    text = (SOURCES / "README.md").read_text()
    block = re.search(rf"```{language}\n(.*?)```", text[text.index(heading) :], re.DOTALL).group(1)
    return block.replace("http://localhost:50051", f"http://{address}")


def test_the_readme_runs_in_a_clean_folder(package, address, tmp_path):
    install = readme_block("sh", "## Install", address)
    # The package is built, and its packages have been fetched.
    cache = run(["npm", "config", "get", "cache"]).strip()
    install = install.replace("cd client/web && npm install && ", "").replace("npm install ~", "npm install --prefer-offline ~")
    settings = {"HOME": str(tmp_path), "npm_config_cache": cache, "npm_config_ignore_scripts": "true"}
    run(["bash", "-euc", install], package, env={**os.environ, **settings})
    first = readme_block("js", "## First call", address)
    assert len(first.splitlines()) <= 15
    (tmp_path / "my-game/find.mjs").write_text(first)
    assert "index-finger-tip" in run(["node", "find.mjs"], tmp_path / "my-game")
    (tmp_path / "my-game/errors.mjs").write_text(readme_block("js", "## Errors", address))
    printed = run(["node", "errors.mjs"], tmp_path / "my-game")
    assert "INVALID_REQUEST" in printed and "requirements.friction is -1" in printed


def test_node_calls_streams_and_tracks(package, address):
    result = json.loads(run(["node", "test/live.mjs", f"http://{address}"], package))
    assert result["golden"]
    assert result["violations"] == ["holdout", "requirements.friction"]
    assert result["reason"] == "INVALID_REQUEST"
    assert result["unreachable"] == [[], None]
    scores = result["scores"]
    assert scores and all(a < b for a, b in zip(scores, scores[1:]))
    assert result["keyFrames"] == 3
    tracked = result["tracked"]
    assert tracked["statuses"][0] == "REPLANNED"
    assert 0 < tracked["answered"] <= tracked["pushed"]
    assert tracked["errors"] == []
    # The hand stays at the object, whatever answers leave out.
    assert tracked["farthest"] < 1e-5
    assert tracked["lostHand"] in ["KEPT", "ADJUSTED", "REPLANNED"]
    assert tracked["lostWarnings"] > 0
    assert (tracked["afterDeletion"], tracked["tracks"], tracked["closed"]) == ("KEPT", 2, "TRACK_NOT_FOUND")
    assert result["meshBytes"] > 10_000


class Pages(http.server.SimpleHTTPRequestHandler):
    """Serves the package's folder, with the observer in each page, and takes what it posts."""

    results = queue.Queue()
    scripts = ""

    def __init__(self, *arguments):
        super().__init__(*arguments, directory=WORK)

    def do_GET(self):
        path = pathlib.Path(self.translate_path(self.path))
        if path.name == "observe.js":
            self.answer((ROOT / "tests/foreign/web_package/observe.js").read_bytes(), "text/javascript")
        elif path.suffix == ".html":
            page = path.read_text()
            self.answer((Pages.scripts + page).encode(), "text/html")
        else:
            super().do_GET()

    def do_POST(self):
        Pages.results.put(json.loads(self.rfile.read(int(self.headers["content-length"]))))
        self.answer(b"", "text/plain")

    def answer(self, content, kind):
        self.send_response(200)
        self.send_header("content-type", kind)
        self.send_header("content-length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def show(package, address):
    """Shows a sample page and returns what the observer saw."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("there is no Chromium")

    def show_page(page, query="", scripts=""):
        Pages.scripts = f'<!doctype html>{scripts}<script src="/observe.js"></script>'
        url = f"http://127.0.0.1:{server.server_port}/client/web/examples/{page}?server=http://{address}{query}"
        options = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run", "--window-size=640,640"]
        options += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--remote-debugging-port=0"]
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
            browser = subprocess.Popen(
                [chromium, *options, f"--user-data-dir={profile}", url], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            try:
                result = Pages.results.get(timeout=LONGEST)
            finally:
                browser.terminate()
                browser.wait(timeout=20)
        assert result["failures"] == []
        picture = base64.b64decode(result["picture"].split(",")[1])
        (PICTURES / f"{page.removesuffix('.html')}{query.replace('&vrm=/', '-')}.png").write_bytes(picture)
        # An empty picture of this size has less.
        assert len(picture) > 5_000
        return result

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Pages) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield show_page
        server.shutdown()


def distances(hand, bones, name=lambda joint: joint):
    """How far bones are from the joints of an answer's hand, by the joint's name."""
    places = {joint: sent["pose"]["position"] for joint, sent in zip(JOINTS, hand["joints"])}
    return {
        joint: sum((at.get(axis, 0) - bone) ** 2 for axis, bone in zip("xyz", bones[name(joint)])) ** 0.5
        for joint, at in places.items()
        if name(joint) in bones
    }


def contact_distances(grasp, bones):
    """How far the digits' contacts are from the skin of the avatar's bones. The object is upright."""
    hand = grasp["hand"]
    wrist, at_object = hand["clientFromWrist"]["position"], hand["objectFromWrist"]["position"]
    distances = []
    for contact in grasp["contacts"]:
        if "digit" not in contact:
            continue
        point = [wrist[axis] - at_object[axis] + contact["position"].get(axis, 0) for axis in "xyz"]
        finger = contact["digit"].removeprefix("DIGIT_").lower().replace("little", "pinky")
        names = [joint for joint in JOINTS if joint.startswith(finger)][-4:][contact["phalanx"] - 1 :][:2]
        start, end = [bones[f"right-{name}"] for name in names]
        radii = [hand["joints"][JOINTS.index(name)]["radius"] for name in names]
        along = [b - a for a, b in zip(start, end)]
        if names[1].endswith("tip"):
            # The fingertip is rounded about a point a radius before the skin, on which the rig's tip is; the file's is inside.
            first, tip = [hand["joints"][JOINTS.index(name)]["pose"]["position"] for name in names]
            length = math.dist(*[[place.get(axis, 0) for axis in "xyz"] for place in (first, tip)]) - radii[1]
            along = [length * d / math.hypot(*along) for d in along]
        share = sum(d * (p - a) for d, p, a in zip(along, point, start)) / sum(d * d for d in along)
        share = min(1, max(0, share))
        near = [a + share * d for a, d in zip(start, along)]
        radius = radii[0] + share * (radii[1] - radii[0])
        distances.append(abs(sum((p - n) ** 2 for p, n in zip(point, near)) ** 0.5 - radius))
    return distances


def test_a_page_poses_a_hand(show):
    seen = show("hand.html")
    apart = distances(seen["answer"]["grasps"][0]["hand"], seen["bones"])
    assert len(apart) == 25
    assert max(apart.values()) < 1e-3, apart


def test_a_page_takes_from_a_tracked_hand(show):
    emulator = '<script src="/client/web/node_modules/iwer/build/iwer.min.js"></script>'
    seen = show("webxr.html", scripts=emulator)
    apart = distances(seen["answer"]["grasp"]["hand"], seen["bones"])
    assert len(apart) == 25
    assert max(apart.values()) < 1e-3, apart


@pytest.mark.parametrize("version", [0, 1])
def test_an_avatar_takes_an_object(show, version):
    write = f"fs.writeFileSync('../../avatar{version}.vrm', avatar({version}))"
    run(["node", "-e", f"import('./test/avatar.mjs').then(({{ avatar }}) => {write})"])
    seen = show("avatar.html", f"&vrm=/avatar{version}.vrm")
    hand = seen["answer"]["grasps"][0]["hand"]
    apart = distances(hand, seen["bones"], lambda joint: f"right-{joint}")
    links = {joint: distance for joint, distance in apart.items() if "phalanx" in joint}
    assert len(links) == 14
    assert max(links.values()) < 1e-3, links
    touching = contact_distances(seen["answer"]["grasps"][0], seen["bones"])
    assert len(touching) > 1
    # Flesh yields by up to 2 mm.
    assert all(distance < 0.0025 for distance in touching), touching
    # The file's tips are inside the skin, on which the rig's are.
    assert max(apart[joint] for joint in apart if "tip" in joint) < 7e-3, apart
