"""Objects, and the holdouts to request: the built-in ones, and random ones with recorded givers."""

import csv
import json
import os
import pathlib
import statistics
import subprocess
import tomllib
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import hand as hands
import pool
from hand import Hand, ROOT
from solids import clearance, Mesh, thinned

BUILT_IN = ["remote", "scalpel", "scissors"]
# Real objects of the recorded data: file name and a typical mass in kilograms.
REAL = {
    "osim_banana": 0.12,
    "osim_hammer": 0.45,
    "osim_knife": 0.1,
    "osim_mug": 0.3,
    "osim_phone": 0.17,
    "osim_scissors": 0.06,
    "osim_toothbrush": 0.02,
    "osim_wineglass": 0.15,
    "xr_google-daydream": 0.04,
    "xr_logitech-mx-ink": 0.03,
    "xr_oculus-go": 0.1,
}
# Recorded poses in which a hand can hold something.
HOLDING = {"Cup", "Grip", "Grip 1", "Grip 2", "Grip 3", "Grip 4", "Grip 5", "Grip Shaft", "Hold", "OK", "Pinch Flat"}
HOLDING |= {"Pinch Large", "Pinch Middle", "Pinch Tight", "Pinch Up", "PingPong", "Rounded", "relax"}
# How deep a giver's skin may be in the object, in metres; a deeper one is placed again.
GIVER_DEPTH = 0.004
# Most placements of a hand; if all are too deep, the shallowest is used.
PLACEMENTS = 24


def data_folder():
    """The folder with real objects and recorded poses, or None."""
    folder = pathlib.Path(os.environ.get("GRASP_TEST_DATA", ROOT.parent / "shared/data"))
    return folder if (folder / "poses").is_dir() else None


def mesh_file(name):
    """The file of an object's mesh."""
    if name in BUILT_IN:
        return ROOT / "assets/objects" / f"{name}.obj"
    if name not in REAL:
        return everyday_file(name)
    return data_folder() / "objects" / f"{name}.obj"


def forbidden_triangles(name, mesh, thing=None):
    """Indices of the triangles that may not be touched; `thing` is the everyday object, if it is one."""
    if name in BUILT_IN:
        groups = json.loads((ROOT / "assets/objects" / f"{name}.json").read_text())["forbidden_groups"]
    else:
        groups = thing.forbidden if thing else []
    return np.flatnonzero(np.isin(mesh.groups, groups))


def built_in_holdouts(name):
    """The built-in holdouts of an object."""
    return sorted(path.stem for path in (ROOT / "assets/holdouts").glob(f"{name}-*.json"))


def recorded_hands():
    """Recorded hands in holding poses, in their wrists' frames; without the data, those of the built-in holdouts."""
    folder, result = data_folder(), []
    if folder is None:
        for path in sorted((ROOT / "assets/holdouts").glob("*.json")):
            entry = json.loads(path.read_text())
            result.append(
                hands.posed(
                    entry["giver_rig"], entry["giver_handedness"], [0, 0, 0], [0, 0, 0, 1], entry["giver_digits"]
                )
            )
        return result
    for file in ["godot_xr_tools_poses.json", "handy-work_poses.json"]:
        for pose in json.loads((folder / "poses" / file).read_text())["poses"]:
            if pose["name"] not in HOLDING:
                continue
            joints = pose["joints"]
            positions = [joints[name]["position"] for name in hands.NAMES[1:]]
            orientations = [joints[name]["orientation_xyzw"] for name in hands.NAMES[1:]]
            # The files have no radii: use the adult rig's, scaled by the length of the middle finger.
            rig = hands.description("adult", pose["handedness"])
            finger = np.linalg.norm(np.diff(np.array(positions)[11:15], axis=0), axis=1).sum()
            scale = finger / sum(rig["digits"]["middle"]["lengths_m"])
            radii = [scale * rig["joint_radii_m"][name] for name in hands.NAMES[1:]]
            result.append(
                Hand.from_joints(
                    pose["handedness"],
                    [
                        {"client_from_joint": {"position": p, "orientation": q}, "radius": r}
                        for p, q, r in zip(positions, orientations, radii)
                    ],
                )
            )
    return result


class Placer:
    """Places hands on an object so that they hold it near one end, as a giver would.

    A pattern search improves random placements of the grip near the object. It models the hand as balls along its
    bones; the cost is low when thumb, two fingers and palm are near the surface and no ball is inside.
    """

    def __init__(self, mesh):
        self.mesh = mesh
        self.all_points, owners = mesh.samples()
        # Samples 3 mm apart are enough to place a hand.
        coarse = thinned(self.all_points, 0.003)
        self.points, self.normals = self.all_points[coarse], mesh.normals[owners[coarse]]
        self.tree = cKDTree(self.points)
        self.middle, self.half = (mesh.low + mesh.high) / 2, (mesh.high - mesh.low) / 2

    def _gaps(self, points):
        """Approximate signed distances, from the nearest sample and its normal."""
        distance, nearest = self.tree.query(points)
        outward = np.einsum("...i,...i->...", points - self.points[nearest], self.normals[nearest])
        return np.where(outward < 0, -distance, distance)

    @staticmethod
    def _balls(hand):
        capsules, tags = hand.solids()
        fractions = np.array([0.0, 0.5, 1.0])
        centres = capsules.starts[:, None] + fractions[None, :, None] * (capsules.ends - capsules.starts)[:, None]
        radii = capsules.start_radii[:, None] + fractions * (capsules.end_radii - capsules.start_radii)[:, None]
        return centres.reshape(-1, 3), radii.ravel(), np.repeat(tags[:, 0], 3)

    def _costs(self, balls, quaternions, translations):
        centres, radii, digits = balls
        turned = Rotation.from_quat(quaternions).as_matrix() @ centres.T
        gaps = self._gaps(turned.transpose(0, 2, 1) + translations[:, None]) - radii
        of_digit = np.stack([np.clip(gaps[:, digits == d].min(axis=1), 0, 0.05) for d in range(-1, 5)], axis=1)
        best = np.sort(of_digit[:, 2:], axis=1)
        reach = of_digit[:, 1] + best[:, 0] + 0.5 * best[:, 1] + 0.1 * of_digit[:, 0]
        return reach + 100 * (np.minimum(gaps, 0) ** 2).sum(axis=1)

    def place(self, hand, random):
        """The hand placed on the object, in the object's frame."""
        shallowest, least = None, np.inf
        for _ in range(PLACEMENTS):
            placed = self._attempt(hand, random)
            capsules, _ = placed.solids()
            depth = max(0.0, -capsules.distances(self.all_points).min())
            if depth < least:
                shallowest, least = placed, depth
            if depth <= GIVER_DEPTH:
                break
        return shallowest

    def _attempt(self, hand, random, starts=400, refined=6):
        balls = self._balls(hand)
        grip = (2 * hand.positions[5] + hand.positions[10] + hand.positions[15]) / 4
        targets = self.middle + random.uniform(-0.5, 0.5, (starts, 3)) * self.half
        axis, end = int(np.argmax(self.half)), random.choice([-1, 1])
        targets[:, axis] = self.middle[axis] + end * random.uniform(0.3, 0.8, starts) * self.half[axis]
        turns = Rotation.random(starts, rng=random)
        quaternions, translations = turns.as_quat(), targets - turns.apply(grip)
        costs = self._costs(balls, quaternions, translations)
        best = np.argsort(costs)[:refined]
        quaternions, translations, costs = quaternions[best], translations[best], costs[best]
        pivot = balls[0].mean(axis=0)
        shift, turn = 0.01, 0.3
        directions = np.concatenate([np.eye(3), -np.eye(3)])
        while shift > 0.0003:
            rotations = Rotation.from_quat(quaternions)
            pivots = rotations.apply(pivot) + translations
            moved = [(quaternions, translations + shift * d) for d in directions]
            for d in directions:
                turned = Rotation.from_rotvec(turn * d) * rotations
                moved.append((turned.as_quat(), pivots - turned.apply(pivot)))
            tried = np.stack([self._costs(balls, q, t) for q, t in moved])
            choice, rows = tried.argmin(axis=0), np.arange(len(costs))
            better = tried[choice, rows] < costs
            if not better.any():
                shift, turn = shift / 2, turn / 2
                continue
            for row in rows[better]:
                quaternions[row] = moved[choice[row]][0][row]
                translations[row] = moved[choice[row]][1][row]
                costs[row] = tried[choice[row], row]
            if better.sum() == 1 and costs[better][0] > costs.min():
                shift, turn = shift * 0.8, turn * 0.8
        winner = int(np.argmin(costs))
        return hand.moved(Rotation.from_quat(quaternions[winner]), translations[winner])


def random_request(name, placer, givers, random):
    """A request with a recorded giver, turned at random as a whole, so gravity may come from any direction."""
    giver = placer.place(givers[random.integers(len(givers))], random)
    turn = Rotation.random(rng=random)
    # Keep the object away from the frame's origin.
    shift = np.array([0.0, 1.2, 0.3])
    giver = giver.moved(turn, shift)
    joints = [
        {"client_from_joint": {"position": p.tolist(), "orientation": q.tolist()}, "radius": float(r)}
        for p, q, r in zip(giver.positions[1:], giver.rotations[1:].as_quat(), giver.radii[1:])
    ]
    return {
        "object": name,
        "client_from_object": {"position": shift.tolist(), "orientation": turn.as_quat().tolist()},
        "presenting_hand": {"joints": {"handedness": giver.handedness, "joints": joints}},
    }


def standing_request(name, random):
    """A request with nobody holding the object: it stands on its -Y side, turned at random about the vertical."""
    turn = Rotation.from_rotvec([0.0, random.uniform(0.0, 2 * np.pi), 0.0])
    pose = {"position": [0.0, 1.2, 0.3], "orientation": turn.as_quat().tolist()}
    return {"object": name, "client_from_object": pose}


def giver_of_request(request):
    """The giver's hand of a request in the client's frame, or None."""
    form = request.get("presenting_hand")
    if not form:
        return None
    if joints := form.get("joints"):
        return Hand.from_joints(joints["handedness"], joints["joints"])
    angles, pose = form["angles"], form["angles"]["client_from_wrist"]
    return hands.posed(angles["rig"], angles["handedness"], pose["position"], pose["orientation"], angles["digits"])


def load_mesh(name):
    """The mesh of an object in metres."""
    return Mesh.read_obj(mesh_file(name))


FOLDER = ROOT / "target/quality/everyday"
PROGRAM = ROOT / "target/release/grasp-everyday"
# Givers per object, and searches for hands that may be givers or receivers, by turns with a right and a left hand. If the
# first few find nothing, the others would not either.
GIVERS, SEARCHES, HOPELESS = 3, 14, 4
# Budget of such a search, in seconds.
SEARCH_SECONDS = 0.5
# Distance between giver and receiver, in metres, from which the giver leaves room.
ROOM = 0.003
# The object is off the client's origin, so that confusing the frames shows.
POSE = {"position": [0.0, 1.2, 0.3], "orientation": [0.0, 0.0, 0.0, 1.0]}
# Requests for both hands on an object beyond one.
BOTH_SEARCHES = 10
# Targets, in percent: of the requests on objects for one hand, alone and with a giver who leaves room, those answered in
# time; and of the requests for both hands, those that are held in simulation.
ALONE, GIVEN, BOTH = 95, 90, 80


@dataclass
class Thing:
    """An everyday object."""

    name: str
    mass_kg: float
    friction: float
    centre_of_mass: list | None
    forbidden: list
    # Why it is beyond one hand; empty if it is not.
    beyond: str


def things():
    """Writes the files of all everyday objects and returns the objects by name."""
    if not PROGRAM.exists():
        raise SystemExit(f"{PROGRAM.relative_to(ROOT)} is missing: cargo build --release --package grasp-everyday")
    subprocess.run([PROGRAM, FOLDER], check=True, capture_output=True, timeout=60)
    result = {}
    with open(FOLDER / "objects.tsv", newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE):
            manifest = tomllib.loads((FOLDER / f"{row['name']}.toml").read_text())
            result[row["name"]] = Thing(
                name=row["name"],
                mass_kg=manifest["mass_kg"],
                friction=manifest["friction"],
                centre_of_mass=manifest.get("centre_of_mass"),
                forbidden=manifest.get("forbidden", {}).get("groups", []),
                beyond=row["beyond_one_hand"],
            )
    return result


def everyday_file(name):
    """The file of an object's mesh."""
    return FOLDER / f"{name}.obj"


def create(service, thing):
    """Creates the object on the server and returns its description."""
    more = ["--friction", thing.friction]
    if thing.centre_of_mass:
        more += ["--centre-of-mass", ",".join(map(str, thing.centre_of_mass))]
    for group in thing.forbidden:
        more += ["--forbidden-group", group]
    return service.create(thing.name, everyday_file(thing.name), thing.mass_kg, *more)


def request(name, giver=None):
    """A request on the object in its usual pose; the giver's hand is in the client's frame."""
    result = {"object": name, "client_from_object": POSE, "receiving_hand": {"handedness": "right"}}
    if giver is not None:
        joints = [
            {"client_from_joint": {"position": p.tolist(), "orientation": q.tolist()}, "radius": float(r)}
            for p, q, r in zip(giver.positions, giver.rotations.as_quat(), giver.radii)
        ]
        form = {"handedness": giver.handedness, "joints": joints}
        result["presenting_hand"] = {"joints": form}
    return result


def requests(thing, givers, seed):
    """The requests on an object: alone, then with each giver; or for both hands, if one cannot hold it. Each with a label."""
    name = f"objects/{thing.name}"
    if thing.beyond:
        for turn in range(BOTH_SEARCHES):
            yield f"both hands {turn}", {**request(name), "hands": "both"}, seed + turn
        return
    yield "alone", request(name), seed
    for number, giver in enumerate(givers, 1):
        yield f"giver {number}", request(name, giver), seed + number


def hands_on(service, thing, seed):
    """Hands in the client's frame with which the service takes the object from nobody."""
    name, hands = create(service, thing)["name"], []
    for turn in range(SEARCHES):
        if turn == HOPELESS and not hands:
            break
        wanted = {
            **request(name),
            "receiving_hand": {"handedness": "left" if turn % 2 else "right"},
            "seed": str(seed + turn),
            "budget_seconds": SEARCH_SECONDS,
            # The first valid hands are spread over an object; better ones meet at its best part.
            "improvement_seconds": 0.0,
        }
        grasp = service.find(wanted)["grasp"]
        if grasp:
            hands.append(Hand.from_joints(grasp["handedness"], grasp["joints"], grasp["rig"]))
    return hands


def leaves_room(giver, receiver):
    """Whether two hands in one frame are clear of each other, forearms included. The receiver's wrist may be bent."""
    fixed, _ = giver.solids()

    def is_clear(capsules):
        return min(clearance(capsules, fixed).min(), clearance(capsules, giver.forearm()).min()) >= ROOM

    return is_clear(receiver.solids()[0]) and any(map(is_clear, receiver.forearms()))


def givers_among(hands, handedness="right"):
    """Up to GIVERS of the hands that leave room for another one of this handedness, or for any if that is None."""
    chosen = []
    for giver in hands:
        others = (other for other in hands if other is not giver and handedness in (None, other.handedness))
        if any(leaves_room(giver, other) for other in others):
            chosen.append(giver)
        if len(chosen) == GIVERS:
            break
    return chosen


def make_givers(service, chosen, seed, handedness="right"):
    """Givers in the client's frame for each of the things, by name, who leave room for a hand of this handedness."""
    result = {}
    for thing in pool.Progress("objects with givers").over(chosen):
        result[thing.name] = givers_among(hands_on(service, thing, seed), handedness)
    return result


def shares(rows):
    """Of the requests alone and of those with givers: how many there are, and how many are answered in time."""
    result = []
    for is_wanted in (lambda label: label == "alone", lambda label: label.startswith("giver")):
        here = [row for row in rows if row.get("everyday") and is_wanted(row["holdout"])]
        result.append((len(here), sum(row["in_time"] for row in here)))
    return result


def cell(row):
    """The answer to one request in a few words."""
    if row is None:
        return "no room"
    if not row["found"]:
        return "**none**"
    time = f"{row['search_ms']:.2f} ms"
    if not row["in_time"]:
        return f"**late**, {time}"
    return f"{time}, {row['type'].replace('_', ' ') or 'no type'}" if "type" in row else time


def table(rows, known):
    """Markdown table of all everyday objects, and of those beyond one hand; empty without any."""
    asked = {}
    for row in rows:
        if row.get("everyday") and not row.get("both"):
            asked.setdefault(row["object"], {})[row["holdout"]] = row
    if not asked:
        return "\n".join(by_both_hands(rows, known))
    labels = ["alone"] + [f"giver {number}" for number in range(1, GIVERS + 1)]
    lines = [f"| object | mass, kg | {' | '.join(labels)} |", "|---|--:|" + "---|" * len(labels)]
    for name, by_label in asked.items():
        cells = [cell(by_label.get(label)) for label in labels]
        lines.append(f"| {name} | {known[name].mass_kg:g} | {' | '.join(cells)} |")
    return "\n".join(lines + by_both_hands(rows, known))


def by_both_hands(rows, known):
    """Lines of a Markdown table of objects beyond one hand."""
    asked = {}
    for row in rows:
        if row.get("both"):
            asked.setdefault(row["object"], []).append(row)
    if not asked:
        return []
    lines = ["", "Beyond one hand, requested for both:", ""]
    lines += ["| object | why | found | median, ms | kept against gravity | against single pushes |"]
    lines += ["|---|---|--:|--:|--:|--:|"]
    for name, here in asked.items():
        found = [row for row in here if row["found"]]
        median = f"{statistics.median(row['search_ms'] for row in found):.1f}" if found else ""
        held = [row for row in found if "survives_gravity" in row]
        gravity = f"{sum(row['survives_gravity'] for row in held)} of {len(here)}" if held else ""
        pushes = f"{sum(row['survives_pushes'] for row in held)} of {6 * len(here)}" if held else ""
        cells = [name, known[name].beyond, f"{len(found)} of {len(here)}", median, gravity, pushes]
        lines.append(f"| {' | '.join(cells)} |")
    return lines
