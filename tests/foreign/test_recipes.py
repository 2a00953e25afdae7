"""Runs the blocks of client/RECIPES.md as printed, except for the server's port, and checks what the page says of each answer.

The blocks above the first recipe come before those of each recipe. `grasp` is the release binary.
"""

import base64
import json
import os
import re
import subprocess
import sys
import urllib.request

import pytest

from conftest import ROOT, start_server, stop_server

PAGE = (ROOT / "client/RECIPES.md").read_text()
INTRODUCTION, *SECTIONS = re.split(r"^## ", PAGE, flags=re.MULTILINE)
RECIPES = {section.split("\n", 1)[0]: section for section in SECTIONS}


def blocks(text, language):
    return "".join(re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL))


@pytest.fixture(scope="module")
def recipe_server():
    process, host_port = start_server("--listen", "127.0.0.1:0")
    shell(blocks(INTRODUCTION, "sh"), host_port)
    yield host_port
    stop_server(process)


def with_address(text, host_port):
    replaced = text.replace("[::1]:50051", host_port)
    assert "50051" not in replaced
    return replaced


def run(command, text, host_port):
    path = os.pathsep.join([str(ROOT / "target/release"), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "GRASP_SERVER": f"http://{host_port}"}
    ended = subprocess.run(
        [*command, with_address(text, host_port)], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def shell(text, host_port):
    return run(["bash", "-euo", "pipefail", "-c"], text, host_port)


def answer_of(title, host_port):
    """The answer of a recipe's last call."""
    text = RECIPES[title]
    python, sh = blocks(text, "python"), blocks(text, "sh")
    # The objects of the introduction are there: only the function is needed.
    function = blocks(INTRODUCTION, "sh").splitlines()[-1]
    said = shell(f"{function}\n{sh}", host_port) if sh else ""
    if python:
        python = f"{blocks(INTRODUCTION, 'python')}\n{python}\nprint(json.dumps(answer))"
        said = run([sys.executable, "-c"], python, host_port)
    return json.loads(said)


def call(host_port, request):
    url = f"http://{host_port}/grasp.v1.GraspService/FindGrasp"
    headers = {"content-type": "application/json"}
    return json.load(urllib.request.urlopen(urllib.request.Request(url, json.dumps(request).encode(), headers)))


def request_of(title):
    """The JSON of a recipe's call in the shell."""
    return json.loads(re.search(r"FindGrasp '(.*?)'", blocks(RECIPES[title], "sh"), re.DOTALL).group(1))


def hand_of(answer):
    assert answer["outcome"] == "OUTCOME_FOUND", answer.get("report")
    return answer["grasps"][0]["hand"]


def vector(message):
    return [message.get(axis, 0.0) for axis in "xyz"]


def contacts(answer):
    return [vector(contact["position"]) for contact in answer["grasps"][0]["contacts"]]


def joints(hand):
    """Positions and radii of the joints that a hand has."""
    there = [joint for joint in hand["joints"] if "pose" in joint]
    return [(vector(joint["pose"]["position"]), joint["radius"]) for joint in there]


def margin(answer, check):
    return next(verdict["value"] for verdict in answer["grasps"][0]["margins"] if verdict["check"] == check)


def mug(answer, _):
    on_handle = [x > 0.026 and abs(z) < 0.009 for x, _, z in contacts(answer)]
    assert 2 * sum(on_handle) >= len(on_handle), contacts(answer)


def knife(answer, _):
    hand_of(answer)
    # The handle ends here, and the blade begins.
    assert all(x < -0.035 for x, _, _ in contacts(answer)), contacts(answer)
    assert margin(answer, "CHECK_GIVER_CLEARANCE") >= 0


def other_hand(answer, _):
    assert hand_of(answer)["handedness"] == "HANDEDNESS_LEFT"
    assert margin(answer, "CHECK_GIVER_CLEARANCE") >= 0
    # The left shoulder of a body that faces -Z.
    assert answer["grasps"][0]["arm"]["clientShoulder"]["x"] < -0.1


def controller(answer, _):
    hand_of(answer)
    assert margin(answer, "CHECK_GIVER_CLEARANCE") >= 0
    assert margin(answer, "CHECK_OBSTACLE_CLEARANCE") >= 0
    assert all(x > 0 for x, _, _ in contacts(answer)), contacts(answer)


def child(answer, _):
    hand = hand_of(answer)
    assert hand["handedness"] == "HANDEDNESS_LEFT" and hand["scale"] == pytest.approx(0.7)
    arm = answer["grasps"][0]["arm"]
    assert 0.8 < arm["clientShoulder"]["y"] < 1.0, arm


def table(answer, _):
    hand = hand_of(answer)
    lowest = min(position[1] - radius for position, radius in joints(hand))
    # Soft flesh, and tips whose radius is that of their end.
    assert lowest > 0.75 - 0.01, lowest
    assert margin(answer, "CHECK_OBSTACLE_CLEARANCE") >= 0


def cartoon(answer, _):
    hand = hand_of(answer)
    assert "little" not in hand and "ring" in hand
    assert len(joints(hand)) == 21


def reproducible(answer, host_port):
    hand_of(answer)
    assert call(host_port, request_of("The same answer in every run"))["grasps"] == answer["grasps"]


def packed(answer, _):
    hand = hand_of(answer)
    data = base64.b64decode(answer["grasps"][0]["packed"])
    assert 40 < len(data) < 70 and data[0] == 1
    assert bool(data[1] & 1) == (hand["handedness"] == "HANDEDNESS_RIGHT")


def importer(answer, host_port):
    there = call(host_port, request_of("The same answer in every run"))
    for (x, y, z), mirrored in zip(contacts(there), contacts(answer), strict=True):
        assert mirrored == pytest.approx([-x, y, z], abs=1e-6)


CHECKS = {
    "A mug by its handle": mug,
    "A knife, with the handle free": knife,
    "From one hand into the other": other_hand,
    "A controller in the giver's hand": controller,
    "A child takes it with the left hand": child,
    "A table in the way": table,
    "A cartoon hand of four fingers": cartoon,
    "The same answer in every run": reproducible,
    "A grasp for all players": packed,
    "The axes of your engine's importer": importer,
}


def test_every_recipe_is_checked():
    assert list(CHECKS) == list(RECIPES)


def test_the_controllers_wrist_is_where_the_page_says():
    """The fist of the request is at the grip that the page describes: the object's x is the grip's -Z."""
    fist = request_of("A controller in the giver's hand")["holdout"]["presentingHand"]["pose"]["objectFromWrist"]
    (x, y, z), (qx, qy, qz, qw) = [
        [float(number) for number in re.search(pattern, PAGE).group(1).split(",")]
        for pattern in (r"wrist is at\s+\(([^)]*)\)", r"turned by \(([^)]*)\)")
    ]
    # x, y and z of the grip in the object's frame are z, y and -x.
    in_object = [-0.03 - z, y, x]
    assert vector(fist["position"]) == pytest.approx(in_object)
    grip_from_wrist = [turned((qx, qy, qz, qw), axis) for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1])]
    orientation = [fist["orientation"].get(part, 0.0) for part in "xyzw"]
    for axis, (a, b, c) in zip(([1, 0, 0], [0, 1, 0], [0, 0, 1]), grip_from_wrist, strict=True):
        assert turned(orientation, axis) == pytest.approx([-c, b, a], abs=1e-3)


def turned(quaternion, vector):
    x, y, z, w = quaternion

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    once = [2 * part for part in cross((x, y, z), vector)]
    twice = cross((x, y, z), once)
    return [vector[i] + w * once[i] + twice[i] for i in range(3)]


@pytest.mark.parametrize("title", RECIPES)
def test_recipe(title, recipe_server):
    answer = answer_of(title, recipe_server)
    hand_of(answer)
    CHECKS[title](answer, recipe_server)
