"""Where people stand when one hands the other an object, and whether a receiver who stands there has this hand.

A giver's hand tells where the giver stands: the forearm goes straight back from the hand, the upper arm hangs from the
shoulder, and the body is behind the forearm. A receiver faces the giver. Shoulders that are plausible for the receiver
are sampled, and for each one the elbows of an arm whose elbow hangs. All is in the client's frame; lengths are in
metres, angles in degrees.

Sources. Lengths of arms and shoulders: ANSUR (Gordon et al. 1989: acromion to elbow 34 cm in men and 31 cm in women,
some 3 cm of it above the joint's centre; elbow to wrist 27 and 24 cm; biacromial breadth 40 and 36 cm); Winter,
Biomechanics and Motor Control of Human Movement (0.186 and 0.146 of the stature, 32 and 25 cm at 1.7 m). Distance:
people who deal with each other stand 0.46 to 1.22 m apart (Hall 1966, personal distance), and where they hand things
over depends on the distance they keep (Hansen et al. 2017). Direction: handing over from the front is preferred (Koay
et al. 2007).
"""

import time
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import hand as hands
import measures
from hand import FOREARM_RADIUS, WRIST
from solids import Capsules, clearance

UPPER_ARM, FOREARM, HALF_SHOULDERS = 0.30, 0.26, 0.18
# Lengths of adults' upper arms and forearms, from small women (5th percentile) to large men (95th) of ANSUR.
UPPER_ARMS, FOREARMS = (0.25, 0.37), (0.21, 0.30)
# Largest flexion of an elbow, extension of a shoulder, and adduction of an upper arm across the body (AAOS: 150, 60 and
# 45; less is comfortable).
ELBOW_FLEXION, SHOULDER_EXTENSION, SHOULDER_ADDUCTION = 145, 60, 40
# Distances between both bodies, azimuths of the receiver from straight opposite, and heights over the giver's shoulder.
DISTANCES = np.linspace(0.6, 1.2, 7)
AZIMUTHS = np.linspace(-60, 60, 9)
HEIGHTS = np.array([-0.15, 0.0, 0.15])
# Least horizontal distance from the giver's wrist to the receiver's middle: two hands and half a trunk.
CLOSEST = 0.35
# A forearm nearer to the vertical tells ever less about where the body is; an upright one tells nothing.
UPRIGHT = 20.0
# How far a giver may hold the elbow forward.
FORWARD = 30.0
# How far an elbow swings from its lowest place, outward and inward, in radians.
SWIVELS = np.radians(np.arange(-30, 61, 15))
# Bounds of the targets: from the nearest plausible forearm, and from the giver's own.
NEAR_RECEIVER, NEAR_GIVER = 75.0, 60.0


def unit(vectors):
    """Vectors scaled to length 1."""
    vectors = np.asarray(vectors, float)
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def angle(a, b):
    """The angle between unit vectors."""
    return np.degrees(np.arccos(np.clip(np.sum(np.asarray(a) * b, axis=-1), -1.0, 1.0)))


def horizontal(vector, up):
    """The unit vector along the horizontal part; of a vertical vector, any horizontal one."""
    flat = vector - vector @ up * up
    if np.linalg.norm(flat) < 1e-6:
        flat = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    return unit(flat)


def turned(vector, axis, degrees):
    """Vectors turned about an axis: a row per angle."""
    turns = np.radians(np.atleast_1d(degrees))[:, None] * axis
    return Rotation.from_rotvec(turns).apply(vector)


def forearm_direction(hand):
    """The direction from wrist to elbow of a forearm that goes straight back from the hand."""
    return hand.rotations[WRIST].apply([0.0, 0.0, 1.0])


@dataclass
class Bodies:
    """Upright people with an arm each, a row per person: shoulder of that arm, and the directions forward and outward.

    Outward is from the other shoulder to this one.
    """

    shoulders: np.ndarray
    forward: np.ndarray
    outward: np.ndarray

    def middles(self):
        """The middles between both shoulders."""
        return self.shoulders - HALF_SHOULDERS * self.outward


def outward_of(forward, up, handedness):
    """The direction from the body to the shoulder of a hand."""
    return (1.0 if handedness == "right" else -1.0) * np.cross(forward, up)


def behind(hand, up):
    """The plausible owners of a hand, the likeliest first: behind the forearm, or anywhere if that is upright.

    The upper arm hangs, or the elbow is forward: a little, and where it would be bent too much, as far as needed.
    """
    back = forearm_direction(hand)
    elbow = hand.positions[WRIST] + FOREARM * back
    steep = np.degrees(np.arccos(np.clip(abs(back @ up), 0.0, 1.0)))
    spread = 180.0 * max(0.0, 1.0 - steep / UPRIGHT)
    sides = np.concatenate([[0.0], *([a, -a] for a in np.arange(30.0, spread + 1e-6, 30.0))])
    rear = turned(horizontal(back, up), up, sides)
    # The upper arm is cos(t) up + sin(t) rear; the angle between it and the forearm must not be too small.
    sharpest = np.cos(np.radians(180 - ELBOW_FLEXION))
    reach, offset = np.hypot(back @ up, rear @ back), np.arctan2(-rear @ back, -back @ up)
    least = np.where(-back @ up > sharpest, offset + np.arccos(np.minimum(sharpest / reach, 1.0)), 0.0)
    # With the elbow farther forward than this, the arm would be bent backward.
    most = np.maximum(least, np.radians(min(FORWARD, angle(up, back))))
    tilts, rears = np.concatenate([least, most])[:, None], np.tile(rear, (2, 1))
    shoulders, forward = elbow + UPPER_ARM * (np.cos(tilts) * up + np.sin(tilts) * rears), -rears
    return Bodies(shoulders, forward, outward_of(forward, up, hand.handedness))


def receivers(giver, up, handedness):
    """The plausible receivers who take something from a giver's hand."""
    givers, wrist = behind(giver, up), giver.positions[WRIST]
    middles, forward = [], []
    for middle, ahead in zip(givers.middles(), givers.forward):
        toward = turned(ahead, up, AZIMUTHS)
        places = middle + DISTANCES[:, None, None] * toward
        apart = np.sum((places - wrist) * toward, axis=-1) >= CLOSEST
        for height in HEIGHTS:
            middles.append(places[apart] + height * up)
            forward.append(-np.broadcast_to(toward, places.shape)[apart])
    forward = np.concatenate(forward)
    outward = outward_of(forward, up, handedness)
    return Bodies(np.concatenate(middles) + HALF_SHOULDERS * outward, forward, outward)


def elbows(wrist, bodies, up):
    """The elbows with which people reach a wrist, and the row of each one's owner; empty if nobody does.

    Elbows hang, so none is higher than its shoulder, and forearms point forward.
    """
    reach = wrist - bodies.shoulders
    distance = np.linalg.norm(reach, axis=1)
    bent = np.radians(180 - ELBOW_FLEXION)
    least = np.sqrt(UPPER_ARM**2 + FOREARM**2 - 2 * UPPER_ARM * FOREARM * np.cos(bent))
    rows = np.flatnonzero((distance >= least) & (distance <= UPPER_ARM + FOREARM))
    along, distance = unit(reach[rows]), distance[rows]
    # Swivel 0 is the lowest elbow; of an arm that hangs straight, the rearmost.
    low = -up - 0.1 * bodies.forward[rows]
    down = unit(low - np.sum(low * along, axis=1)[:, None] * along)
    side = np.cross(along, down)
    side *= np.where(np.sum(side * bodies.outward[rows], axis=1) < 0, -1.0, 1.0)[:, None]
    share = (UPPER_ARM**2 - FOREARM**2 + distance**2) / (2 * distance)
    radius = np.sqrt(np.maximum(UPPER_ARM**2 - share**2, 0.0))
    circle = np.cos(SWIVELS)[None, :, None] * down[:, None] + np.sin(SWIVELS)[None, :, None] * side[:, None]
    upper = (share[:, None] * along)[:, None] + radius[:, None, None] * circle
    owners = np.repeat(rows, len(SWIVELS))
    upper = upper.reshape(-1, 3)
    lifted, ahead, out = (
        np.sum(upper * axis, axis=1) / UPPER_ARM for axis in (up, bodies.forward[owners], bodies.outward[owners])
    )
    natural = lifted <= 1e-9
    natural &= ahead >= -np.sin(np.radians(SHOULDER_EXTENSION))
    natural &= np.sum((wrist - bodies.shoulders[owners] - upper) * bodies.forward[owners], axis=1) >= 0
    natural &= out >= -np.sin(np.radians(SHOULDER_ADDUCTION))
    return bodies.shoulders[owners[natural]] + upper[natural], owners[natural]


def wrist_bend(hand, directions):
    """Flexion, and deviation toward the little finger, of a wrist whose forearm goes in these directions."""
    local = hand.rotations[WRIST].inv().apply(np.atleast_2d(directions))
    flexion = np.degrees(np.arcsin(np.clip(-local[:, 1], -1.0, 1.0)))
    side = 1.0 if hand.handedness == "right" else -1.0
    return flexion, np.degrees(np.arctan2(side * local[:, 0], local[:, 2]))


def wrist_allows(hand, directions):
    """Whether the wrist can bend so that its forearm goes in each of these directions."""
    flexion, deviation = wrist_bend(hand, directions)
    allowed = (flexion >= -hands.EXTENSION) & (flexion <= hands.FLEXION)
    return allowed & (deviation >= -hands.RADIAL) & (deviation <= hands.ULNAR)


@dataclass
class Stance:
    """The plausible receiver whose forearm is nearest to that of a hand."""

    bodies: Bodies
    owner: int
    elbow: np.ndarray
    angle: float
    reachable: bool


def nearest(hand, bodies, up):
    """The plausible arm for a hand; among several that the wrist allows, the one with the straightest wrist.

    Where nobody reaches the wrist, the forearms would point straight at the shoulders.
    """
    wrist, back = hand.positions[WRIST], forearm_direction(hand)
    points, owners = elbows(wrist, bodies, up)
    reached = len(points) > 0
    if not reached:
        owners = np.arange(len(bodies.shoulders))
        points = wrist + FOREARM * unit(bodies.shoulders - wrist)
    directions = unit(points - wrist)
    off = angle(directions, back)
    allowed = wrist_allows(hand, directions) if reached else np.zeros(len(off), bool)
    best = int(np.argmin(np.where(allowed, off, off + 360.0)))
    return Stance(bodies, int(owners[best]), points[best], float(off.min()), bool(allowed.any()))


def judge(scene, grasp):
    """The measures of a grasp by name: those of the receiver's stance only if somebody holds the object."""
    hand = measures.hand_of_reply(grasp)
    row = arm_of_reply(scene, hand, grasp)
    if scene.giver is None:
        return row
    own, giver = forearm_direction(hand), forearm_direction(scene.giver)
    found = nearest(hand, receivers(scene.giver, scene.up, hand.handedness), scene.up)
    row["receiver_angle"], row["elbow_reachable"] = found.angle, found.reachable
    row["giver_angle"] = float(angle(own, giver))
    row["stance_fits"] = found.angle <= NEAR_RECEIVER and found.reachable
    owners = behind(scene.giver, scene.up)
    # Whose forearm is upright may have the body on any side.
    if np.ptp(owners.forward, axis=0).max() < 1e-9:
        middle = scene.translation + scene.rotation.apply((scene.mesh.low + scene.mesh.high) / 2)
        elbow = hand.positions[WRIST] + FOREARM * own
        row["own_side"] = bool((elbow - middle) @ owners.forward[0] > 0)
    return row


def fits(scene, grasp):
    """Whether a plausible receiver has the hand of a grasp; true if nobody holds the object."""
    return judge(scene, grasp).get("stance_fits", True)


def arm_of_reply(scene, hand, grasp):
    """Whether the arm in a reply is one that people have and clears giver and object; nothing if there is none."""
    if not grasp.get("arm"):
        return {}
    wrist = hand.positions[WRIST]
    shoulder, elbow = (np.array(grasp["arm"][name], float) for name in ("client_shoulder", "client_elbow"))
    upper, fore = np.linalg.norm(shoulder - elbow), np.linalg.norm(wrist - elbow)
    bend = 180.0 - angle(unit(shoulder - elbow), unit(wrist - elbow))
    capsule = Capsules([wrist], [elbow], [hand.radii[WRIST]], [FOREARM_RADIUS])
    inverse = scene.rotation.inv()
    local = Capsules(*scene.to_object([wrist, elbow])[:, None], capsule.start_radii, capsule.end_radii)
    gap = float(local.distances(measures.surface_samples(scene.mesh)[0]).min())
    if scene.giver is not None:
        gap = min(gap, clearance(capsule, scene.giver.solids()[0]).min())
        gap = min(gap, clearance(capsule, scene.giver.forearm()).min())
    return {
        "arm_lengths_right": bool(UPPER_ARMS[0] <= upper <= UPPER_ARMS[1] and FOREARMS[0] <= fore <= FOREARMS[1]),
        "arm_joints_right": bool(bend <= ELBOW_FLEXION and wrist_allows(hand, unit(elbow - wrist))[0]),
        "arm_clearance": float(gap),
    }


def lines(found):
    """Lines of the table of targets: measure, target, figure, and whether it is met."""
    given = [row for row in found if "stance_fits" in row]
    result = []
    if given:
        searched = any("stance_possible" in row for row in given)
        asked = [row for row in given if row["stance_fits"] or row.get("stance_possible", not searched)]
        fits = sum(row["stance_fits"] for row in asked)
        share = 100 * fits / max(len(asked), 1)
        rest = f"{len(given) - len(asked)} more have none" if searched else "whether others have any: --search-stance"
        name = f"forearm within {NEAR_RECEIVER:.0f}° of a plausible receiver's, elbow reachable, where any has that"
        figure = f"{share:.0f} % ({fits} of {len(asked)}; {rest})"
        result.append((name, "≥ 95 %", figure, share >= 95))
        angles = np.array([row["receiver_angle"] for row in given])
        reached = sum(row["elbow_reachable"] for row in given)
        figure = f"median {np.median(angles):.0f}°; elbow reachable {100 * reached / len(given):.0f} %"
        result.append(("forearm off a plausible receiver's", "reported", figure, None))
        near = sum(row["giver_angle"] < NEAR_GIVER for row in given)
        share = 100 * near / len(given)
        figure = f"{share:.1f} % ({near} of {len(given)})"
        result.append((f"forearm within {NEAR_GIVER:.0f}° of the giver's own direction", "≤ 3 %", figure, share <= 3))
        sided = [row["own_side"] for row in given if "own_side" in row]
        if sided:
            figure = f"{100 * np.mean(sided):.0f} % ({sum(sided)} of {len(sided)})"
            result.append(("elbow on the receiver's side of the object", "reported", figure, None))
    armed = [row for row in found if "arm_clearance" in row]
    for name, bad in [
        ("an arm with wrong lengths", lambda row: not row["arm_lengths_right"]),
        ("an arm with a joint beyond its range", lambda row: not row["arm_joints_right"]),
        ("an arm that touches object or giver", lambda row: row["arm_clearance"] < 0),
    ]:
        if armed:
            count = sum(map(bad, armed))
            result.append((name, "0", f"{count} of {len(armed)} ({100 * count / len(armed):.0f} %)", count == 0))
    return result


# Time for one holdout and for one request, in seconds.
SECONDS, REQUEST_SECONDS = 5.0, 1.0
# Number of plausible receivers to request.
RECEIVERS = 6
# Half angles of the cones in radians, by turns. A hand approaches at 45° to its forearm, so a narrower cone would leave
# out straight wrists.
HALF_ANGLES = (1.3, 1.0)
# From an object's middle to the wrist of a hand that holds it, in metres.
HAND_LENGTH = 0.12


def wishes(scene, handedness):
    """Constraints toward plausible receivers with an elbow within reach, as different as possible."""
    middle = scene.translation + scene.rotation.apply((scene.mesh.low + scene.mesh.high) / 2)
    bodies = receivers(scene.giver, scene.up, handedness)
    # The wrist is between object and shoulder.
    near = middle + HAND_LENGTH * unit(bodies.shoulders.mean(axis=0) - middle)
    points, owners = elbows(near, bodies, scene.up)
    if len(points) == 0:
        owners = np.arange(len(bodies.shoulders))
        points = near + FOREARM * unit(bodies.shoulders - near)
    directions = unit(points - near)
    chosen = [int(np.argmax(directions @ unit(directions.sum(axis=0))))]
    while len(chosen) < min(RECEIVERS, len(directions)):
        chosen.append(int(np.argmax((1 - directions @ directions[chosen].T).min(axis=1))))
    reach = UPPER_ARM + FOREARM
    for pick in chosen:
        shoulder = bodies.shoulders[owners[pick]]
        yield (-directions[pick]).tolist(), {"client_shoulder": shoulder.tolist(), "reach": reach}


def has_fitting(service, request, scene, handedness):
    """Whether a search within SECONDS finds a valid grasp that fits a plausible receiver."""
    until = time.monotonic() + SECONDS
    asked = list(wishes(scene, handedness))
    turn = 0
    while asked and time.monotonic() < until:
        hopeless = []
        for wish in asked:
            direction, reach = wish
            half_angle = HALF_ANGLES[turn % len(HALF_ANGLES)]
            constraints = {
                **(request.get("constraints") or {}),
                "receiver_reach": reach,
                "approach": {"client_direction": direction, "half_angle": half_angle},
            }
            more = {"seed": str(turn), "budget_seconds": REQUEST_SECONDS, "constraints": constraints}
            grasp = service.find({**request, **more})["grasp"]
            if grasp is None:
                hopeless.append(wish)
            elif fits(scene, grasp):
                return True
            if time.monotonic() > until:
                break
        asked = [wish for wish in asked if wish not in hopeless]
        turn += 1
    return False
