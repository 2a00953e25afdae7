"""Runs the release server on a free port and calls it through the client's binary."""

import json
import os
import pathlib
import re
import signal
import subprocess
import threading
import time

import numpy as np
from scipy.spatial.transform import Rotation

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Exit code of `grasp find` when it found no grasp within the budget.
EXHAUSTED = 3


class Service:
    """A running server, as a context manager."""

    def __init__(self, workers=None, *more):
        command = [ROOT / "target/release/grasp-server", "--listen", "127.0.0.1:0", "--log", "grasp_server=info"]
        # Complete atlases are grown once and shared with the Rust tests and benches.
        command += ["--atlas-directory", ROOT / "target/atlases"]
        if workers:
            command += ["--workers", str(workers)]
        command += more
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "NO_COLOR": "1", "GRASP_STORE": "memory"},
        )
        for line in self.process.stderr:
            if match := re.search(r"127\.0\.0\.1:\d+", line):
                self.url = f"http://{match.group(0)}"
                break
        else:
            raise RuntimeError(f"the server exited with {self.process.wait()} before it logged its address")
        # Drain the log: a full pipe would block the server.
        threading.Thread(target=lambda: self.process.stderr.read(), daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(timeout=20)

    def _run(self, *arguments, stdin=None, accept=(0,)):
        done = subprocess.run(
            [ROOT / "target/release/grasp", "--json", *map(str, arguments), "--server", self.url],
            input=stdin,
            capture_output=True,
            text=True,
            timeout=60,
            env={**os.environ, "NO_COLOR": "1", "GRASP_LOG": "grasp=debug"},
        )
        if done.returncode not in accept:
            raise RuntimeError(f"grasp {arguments[0]} exited with {done.returncode}: {done.stderr.strip()}")
        return done

    def _object(self, *arguments):
        return object_of(json.loads(self._run("objects", *arguments).stdout))

    def create(self, identifier, path, mass, *more):
        """Creates an object from a file and returns the server's description of it; `more` are options of the client."""
        return self._object("create", identifier, "--mesh", path, "--mass", mass, *more)

    def object(self, name):
        """The server's description of an object."""
        return self._object("get", name)

    def wait_for_atlases(self, names, seconds=600):
        """Returns once the atlases of some objects are complete, which takes a minute or two the first time."""
        deadline = time.monotonic() + seconds
        for name in names:
            # Only complete atlases answer reproducible requests.
            request = {"object": f"objects/{name}", "receiving_hand": {"handedness": "right"}, "choice": "reproducible"}
            while not self.find({**request, "max_attempts": 1, "budget_seconds": 0.05})["atlases"]:
                if time.monotonic() > deadline:
                    raise RuntimeError(f"the atlas of {name} is not complete after {seconds} s")
                time.sleep(0.2)

    def find(self, request, choice=None, no_atlas=False, picture=None):
        """The answer to a request, with the time that it took."""
        extra = ["--png", picture, "--view-size", "480x400"] if picture else []
        asked = {**request, "choice": choice or request.get("choice"), "ignore_atlas": no_atlas or None}
        message = json.dumps(to_message(asked))
        done = self._run("find", "--request", "-", *extra, stdin=message, accept=(0, EXHAUSTED))
        answer = answer_of(json.loads(done.stdout))
        answer["round_trip_seconds"] = float(re.search(r"round_trip_seconds=([0-9.e-]+)", done.stderr).group(1))
        return answer


def built_in_request(holdout):
    """The request of a built-in holdout."""
    done = subprocess.run(
        [ROOT / "target/release/grasp", "find", "--holdout", holdout, "--print-request"],
        capture_output=True,
        text=True,
        check=True,
        timeout=20,
    )
    return request_of(json.loads(done.stdout))


DIGITS = ["thumb", "index", "middle", "ring", "little"]
# Links of a digit, from the wrist on; contacts of the palm have none.
PHALANGES = [None, "first", "second", "third"]
VECTORS = {"position", "orientation", "up", "client_shoulder", "client_approach", "half_extents"}
# Messages that hold the judge's top-level keys in requests.
PLACES = {
    "object": "holdout",
    "client_from_object": "holdout",
    "up": "holdout",
    "friction": "requirements",
    "seed": "search",
    "max_attempts": "search",
    "choice": "search",
    "ignore_atlas": "search",
    "budget_seconds": "search",
}
# Prefixes of the names of values, by the keys of requests that have them.
PREFIXES = {
    "handedness": "HANDEDNESS",
    "strategy": "STRATEGY",
    "choice": "GRASP_CHOICE",
    "must_touch": "DIGIT",
    "must_not_touch": "DIGIT",
    "allowed_grasp_types": "GRASP_TYPE",
    "excluded_grasp_types": "GRASP_TYPE",
}
CHOICES = {"first": "first_valid", "best": "best_within_budget"}
# The judge's names for the margins of a grasp.
MARGINS = {
    "CHECK_BALANCE": "residual",
    "CHECK_CLOSURE": "epsilon",
    "CHECK_PENETRATION": "penetration",
    "CHECK_GIVER_CLEARANCE": "giver_clearance",
    "CHECK_OBSTACLE_CLEARANCE": "obstacle_clearance",
}


def to_message(request):
    """A request as protobuf's JSON. Values of None are left out."""
    request = {key: value for key, value in request.items() if value is not None}
    parts = {"holdout": {}, "receiver": {}, "requirements": {}, "search": {}}
    for key, part in PLACES.items():
        if key in request:
            parts[part][key] = request.pop(key)
    if "choice" in parts["search"]:
        parts["search"]["choice"] = CHOICES.get(parts["search"]["choice"], parts["search"]["choice"])
    if "improvement_seconds" in request:
        parts["search"]["refinement_time_seconds"] = request.pop("improvement_seconds")
    if "presenting_hand" in request:
        parts["holdout"]["presenting_hand"] = _giver(request.pop("presenting_hand"))
    receiver = parts["receiver"]
    receiver.update(request.pop("receiving_hand", {}))
    if receiver.get("rig"):
        receiver["rig"] = f"rigs/{receiver['rig'].removeprefix('rigs/')}"
    receiver["both_hands"] = request.pop("hands", "one") == "both"
    wanted = dict(request.pop("constraints", {}))
    if reach := wanted.pop("receiver_reach", None):
        receiver.update(client_shoulder=reach["client_shoulder"], max_reach=reach["reach"])
    if approach := wanted.pop("approach", None):
        wanted.update(client_approach=approach["client_direction"], max_approach_angle=approach["half_angle"])
    parts["requirements"].update(wanted)
    parts["requirements"]["thesis"] = {
        "thesis_validity": request.pop("validity", "physical") == "thesis",
        "strategy": request.pop("strategy", None),
    }
    if request:
        raise ValueError(f"a request has no {', '.join(request)}")
    return _written(parts)


def _giver(form):
    """A giver's hand as a message."""
    if joints := form.get("joints"):
        places = [{"pose": joint["client_from_joint"], "radius": joint["radius"]} for joint in joints["joints"]]
        return {"joints": {"handedness": joints["handedness"], "joints": places}}
    angles = form["angles"]
    hand = {"rig": f"rigs/{angles['rig']}", **{key: angles[key] for key in ("handedness", "client_from_wrist")}}
    return {"pose": {**hand, **dict(zip(DIGITS, angles["digits"]))}}


def _written(value, key=None):
    """Lists, numbers of seconds and names as protobuf's JSON has them."""
    if isinstance(value, dict):
        named = {name: entry for name, entry in value.items() if entry is not None}
        return {
            name.removesuffix("_seconds"): f"{entry}s" if name.endswith("_seconds") else _written(entry, name)
            for name, entry in named.items()
        }
    if key in VECTORS:
        return dict(zip("xyzw", map(float, value)))
    if isinstance(value, (list, tuple)):
        return [_written(entry, key) for entry in value]
    if key in PREFIXES:
        return f"{PREFIXES[key]}_{value.upper()}"
    return value


def request_of(message):
    """A request for a grasp of an object in the hand of a rig."""
    holdout = message["holdout"]
    hand = holdout["presentingHand"]["pose"]
    angles = {
        "rig": hand["rig"].removeprefix("rigs/"),
        "handedness": _name(hand["handedness"]),
        "client_from_wrist": _pose(hand["clientFromWrist"]),
        "digits": _digits(hand),
    }
    request = {"object": holdout["object"], "client_from_object": _pose(holdout.get("clientFromObject", {}))}
    if "up" in holdout:
        request["up"] = _vector(holdout["up"])
    return {**request, "presenting_hand": {"angles": angles}}


def object_of(message):
    """The server's description of an object."""
    result = {
        "name": message["name"],
        "mass_kg": message["massKg"],
        "centre_of_mass": _vector(message["centerOfMass"]),
        "box_half_extents": _vector(message["boundingBox"]["halfExtents"]),
    }
    return {**result, "friction": message["friction"]} if "friction" in message else result


def answer_of(message):
    """The answer to a request."""
    grasps = [_grasp(grasp) for grasp in message.get("grasps", [])] + [None, None]
    report = message.get("report", {})
    seconds = float(report.get("searchTime", "0s").removesuffix("s"))
    return {
        "outcome": _name(message["outcome"]),
        "grasp": grasps[0],
        "other_grasp": grasps[1],
        "report": {"search_time_seconds": seconds, "attempts": int(report.get("attempts", 0))},
        "atlases": message.get("origin", {}).get("atlases", []),
    }


def _grasp(message):
    """One hand that holds an object. Absent fields have a meaning in answers."""
    hand = message["hand"]
    in_client, in_object = _pose(hand["clientFromWrist"]), _pose(hand["objectFromWrist"])
    turn = Rotation.from_quat(in_client["orientation"]) * Rotation.from_quat(in_object["orientation"]).inv()
    shift = np.array(in_client["position"]) - turn.apply(in_object["position"])
    contacts = [
        {
            "client_position": (turn.apply(_vector(contact.get("position"))) + shift).tolist(),
            "client_normal": turn.apply(_vector(contact.get("normal"))).tolist(),
            "client_force": turn.apply(_vector(contact.get("force"))).tolist(),
            "digit": _name(contact["digit"]) if "digit" in contact else None,
            "phalanx": PHALANGES[contact.get("phalanx", 0)],
            "torsion": contact.get("torsion", 0.0),
        }
        for contact in message.get("contacts", [])
    ]
    result = {
        "rig": hand["rig"].removeprefix("rigs/"),
        "handedness": _name(hand["handedness"]),
        "client_from_wrist": in_client,
        "object_from_wrist": in_object,
        "digits": _digits(hand),
        "joints": [
            {"client_from_joint": _pose(joint["pose"]), "radius": joint["radius"]} for joint in hand["joints"]
        ],
        "contacts": contacts,
        "type": _name(message["type"]) if "type" in message else None,
        "type_confidence": message.get("typeConfidence", 0.0),
        "comfort": message.get("thesis", {}).get("comfort", 0.0),
        "margins": {MARGINS[margin["check"]]: margin.get("value", 0.0) for margin in message.get("margins", [])},
        "hangs": message.get("hangs", False),
    }
    if arm := message.get("arm"):
        places = {"client_shoulder": _vector(arm["clientShoulder"]), "client_elbow": _vector(arm["clientElbow"])}
        bends = {"wrist_flexion": arm.get("wristFlexion", 0.0), "wrist_deviation": arm.get("wristDeviation", 0.0)}
        result["arm"] = {**places, **bends}
    return result


def _name(value):
    """The name of an enumeration's value without the prefix that all of them share."""
    return re.sub("^(HANDEDNESS|DIGIT|GRASP_TYPE|OUTCOME)_", "", value).lower()


def _vector(message):
    return [float((message or {}).get(axis, 0.0)) for axis in "xyz"]


def _pose(message):
    orientation = message.get("orientation", {"w": 1.0})
    return {
        "position": _vector(message.get("position")),
        "orientation": [float(orientation.get(axis, 0.0)) for axis in "xyzw"],
    }


def _digits(hand):
    """The angles of each digit, as far as the message has them."""
    names = {
        "base_yaw": "baseYaw", "base_pitch": "basePitch", "second_pitch": "secondPitch", "third_pitch": "thirdPitch"
    }  # fmt: skip
    return [
        {name: hand.get(digit, {}).get(key, None if name == "third_pitch" else 0.0) for name, key in names.items()}
        for digit in DIGITS
    ]
