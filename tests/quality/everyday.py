"""Everyday objects, whose files grasp-everyday writes, and givers for them.

A giver is a hand with which the service itself takes the object from nobody. It leaves room if the service knows a right
hand that takes the same object without touching the giver: then there is at least one answer.
"""

import csv
import statistics
import subprocess
import tomllib
from dataclasses import dataclass

import pool
from hand import ROOT, Hand
from solids import clearance

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
# Requests for both hands on what is beyond one.
BOTH_SEARCHES = 10
# Targets, in percent: of the requests on what one hand can hold, alone and with a giver who leaves room, those answered in
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
    """Writes the files of all everyday objects and returns what they say, by name."""
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


def mesh_file(name):
    """The file of an object's mesh."""
    return FOLDER / f"{name}.obj"


def create(service, thing):
    """Creates the object on the server and returns its description."""
    more = ["--friction", thing.friction]
    if thing.centre_of_mass:
        more += ["--centre-of-mass", ",".join(map(str, thing.centre_of_mass))]
    for group in thing.forbidden:
        more += ["--forbidden-group", group]
    return service.create(thing.name, mesh_file(thing.name), thing.mass_kg, *more)


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
    """Lines of a Markdown table of what is beyond one hand."""
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
