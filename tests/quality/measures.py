"""The measures of one grasp, taken from the request and the reply alone.

Inputs are the joint poses with radii, contacts and forces, moved to the object's frame by the object's pose in the
request. Lengths are in metres, angles in degrees, forces in newtons.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear, nnls
from scipy.spatial.transform import Rotation

from hand import DIGITS, Hand, PHALANGES
from solids import clearance, Mesh

GRAVITY = 9.81
# Bounds of the targets in metres.
OFF_MESH, OFF_SKIN, FORBIDDEN = 0.0005, 0.002, 0.002
# Overlap of two parts of a hand, in metres, that counts as touch: flesh is soft. Adjacent fingers share skin at their
# roots, so their capsules overlap more: by 0 to 5 mm in recorded hands, by 10 mm and more where fingers cross.
FLESH, NEIGHBOURS_FLESH = 0.002, 0.005
# How far a joint may be beyond its limit, in degrees; rounding is far below.
LIMIT_TOLERANCE = 0.5
# How far a joint may be from where the rig's bones put it, in metres; beyond, it belongs to another hand.
BONE_TOLERANCE = 0.001
# A finger with both knuckles bent by less than this many degrees is stretched.
STRETCHED = 10.0
# A contact's normal may be that of any triangle this near, in metres, within this angle, in degrees.
NORMAL_REACH, NORMAL_ANGLE = 0.0005, 15.0
# At an edge or corner it may also lie between the normals of the triangles that meet there. They are this near, in
# metres: just rounding in single precision, or both sides of a blade would count as an edge.
EDGE_REACH = 0.00002
# Strongest press of a digit, in newtons (thesis 2.5).
STRONGEST = 27.0
# A contact's largest torsion over friction times force, in metres: two thirds of the radius, some 6 mm, of a pad's
# evenly pressed patch under a few newtons. Slip and torsion share the friction (an ellipse).
TORSION_RADIUS = 0.004
# Largest swing of a load in hooked fingers until it is at rest, in degrees.
SWING = 32.0
# Range of the length that epsilon divides torques by, in metres.
HAND_LENGTHS = (0.02, 0.06)
# Comfortable shares of the force, thumb first (thesis 4.6).
SHARES = np.array([0.25, 0.25, 0.25, 0.125, 0.125])


@dataclass
class Scene:
    """The request: mesh and centre of mass in the object's frame, up and giver in the client's."""

    mesh: Mesh
    mass: float
    centre_of_mass: np.ndarray
    friction: float
    # Length that turns torques into forces: half the diagonal of the object's box.
    reach: float
    forbidden: np.ndarray
    rotation: Rotation
    translation: np.ndarray
    up: np.ndarray
    giver: Hand | None
    # None if the service may choose.
    asked_handedness: str | None = "right"

    def to_object(self, points):
        """Maps points from the client's frame to the object's."""
        return self.rotation.inv().apply(np.asarray(points, float).reshape(-1, 3) - self.translation)


def hand_of_reply(grasp):
    """The receiving hand of a reply in the client's frame."""
    return Hand.from_joints(grasp["handedness"], grasp["joints"], grasp["rig"])


def in_object_frame(scene, grasp):
    """The receiving hand and the contacts of a reply in the object's frame, the frame of the mesh file."""
    inverse = scene.rotation.inv()
    hand = hand_of_reply(grasp).moved(inverse, -inverse.apply(scene.translation))
    contacts = [
        {
            "position": scene.to_object(contact["client_position"])[0],
            "normal": inverse.apply(contact["client_normal"]),
            "force": inverse.apply(contact["client_force"]),
            # Contacts of the palm have neither digit nor phalanx.
            "digit": contact.get("digit"),
            "phalanx": contact.get("phalanx"),
            "torsion": contact.get("torsion"),
        }
        for contact in grasp["contacts"]
    ]
    return hand, contacts


def judge(scene, grasp):
    """All measures of a grasp by name."""
    hand = hand_of_reply(grasp)
    inverse = scene.rotation.inv()
    local, contacts = in_object_frame(scene, grasp)
    giver = scene.giver and scene.giver.moved(inverse, -inverse.apply(scene.translation))
    return {
        **penetration(scene.mesh, local),
        **forces(scene, contacts, inverse.apply(scene.up), grasp.get("hangs")),
        **epsilon(scene, contacts),
        **fingers(local, contacts),
        "hangs": bool(grasp.get("hangs")),
        **contact_places(scene.mesh, local, contacts),
        **giver_clearance(scene.mesh, local, giver),
        **self_clearance(local),
        **forbidden_distance(scene, local),
        "wrong_chirality": hand.chirality() != hand.handedness or scene.asked_handedness not in (None, hand.handedness),
        **comfort(contacts, grasp["comfort"]),
        **reported_margins(grasp),
        **reported_type(grasp),
        "contacts": len(contacts),
        "digits_touching": len({contact["digit"] for contact in contacts} & set(DIGITS)),
        "palm_touching": any(contact["digit"] not in DIGITS for contact in contacts),
    }


def penetration(mesh, hand):
    """Penetration: the deeper of skin inside the object and of the object's surface inside flesh."""
    capsules, tags = hand.solids()
    skin, owners = capsules.skin(0.002)
    near = ((skin > mesh.low) & (skin < mesh.high)).all(axis=1)
    skin, owners = skin[near], owners[near]
    skin_depth = 0.0
    if len(skin):
        # Points inside another capsule are not skin.
        others = capsules.distances(skin)
        others[np.arange(len(skin)), owners] = np.inf
        skin_depth = mesh.depth(skin[others.min(axis=1) > -1e-6])
    points = surface_near(mesh, hand)
    flesh_depth, part = 0.0, ""
    if len(points):
        distances = capsules.distances(points).min(axis=0)
        worst = int(np.argmin(distances))
        flesh_depth = max(0.0, -float(distances[worst]))
        digit, phalanx = tags[worst]
        part = "palm" if digit < 0 else f"{DIGITS[digit]} {PHALANGES[phalanx]}"
    return {
        "penetration": max(skin_depth, flesh_depth),
        "skin_in_object": skin_depth,
        "object_in_flesh": flesh_depth,
        "deepest_part": part if flesh_depth > 0 else "",
    }


def surface_samples(mesh):
    """The mesh's sample points, computed once."""
    if not hasattr(mesh, "sampled"):
        mesh.sampled = mesh.samples()
    return mesh.sampled


def surface_near(mesh, hand, margin=0.03):
    """Sample points of the surface within reach of the hand."""
    points = surface_samples(mesh)[0]
    low, high = hand.positions.min(axis=0) - margin, hand.positions.max(axis=0) + margin
    return points[((points > low) & (points < high)).all(axis=1)]


def at_rest(centre_of_mass, contacts, up):
    """The centre of mass of a load that hangs in contacts with forces, after it has swung until it is below the forces.

    It swings about the middle of the contacts, and by SWING at most.
    """
    pivot = np.mean([contact["position"] for contact in contacts], axis=0)
    lift = np.array([contact["force"] for contact in contacts])
    torque = np.cross([contact["position"] - pivot for contact in contacts], lift).sum(axis=0)
    # Where the forces' sum acts, horizontally.
    offset = np.cross(up, torque) / max(lift.sum(axis=0) @ up, 1e-9)
    length = np.linalg.norm(centre_of_mass - pivot)
    below = pivot + offset - up * np.sqrt(max(length**2 - offset @ offset, 0.0))
    cosine = (below - pivot) @ (centre_of_mass - pivot) / length**2
    return below if cosine >= np.cos(np.radians(SWING)) else centre_of_mass


def forces(scene, contacts, up, hangs=False):
    """Whether the forces are inside their cones, and the share of the weight that they leave unbalanced.

    The imbalance combines force, and torque over the object's reach. A hanging load is at rest.
    """
    weight = scene.mass * GRAVITY
    if not contacts:
        return {"force_outside_cone": True, "imbalance": 1.0, "largest_force": 0.0}
    force = np.array([contact["force"] for contact in contacts])
    normal = np.array([contact["normal"] for contact in contacts])
    centre_of_mass = at_rest(scene.centre_of_mass, contacts, up) if hangs else scene.centre_of_mass
    arm = np.array([contact["position"] for contact in contacts]) - centre_of_mass
    pressed = -np.einsum("ci,ci->c", force, normal)
    sideways = np.linalg.norm(force + pressed[:, None] * normal, axis=1)
    size = np.linalg.norm(force, axis=1)
    # A force that is not zero presses inward, and inside its cone but for rounding.
    inside = sideways <= scene.friction * pressed + 1e-3 * size + 1e-6
    missing = force.sum(axis=0) - weight * up
    torque = np.cross(arm, force).sum(axis=0)
    limit = scene.friction * TORSION_RADIUS * np.maximum(pressed, 0.0)
    if any(contact["torsion"] for contact in contacts):
        torsion = np.array([contact["torsion"] for contact in contacts], float)
        allowed = limit * np.sqrt(np.maximum(1 - (sideways / (scene.friction * np.maximum(pressed, 1e-9))) ** 2, 0.0))
        inside &= np.abs(torsion) <= allowed + 1e-2 * limit + 1e-7
        torque = torque - normal.T @ torsion
    else:
        # Without torsions in the reply, take those that balance best within friction.
        bounds = (-limit - 1e-12, limit + 1e-12)
        torque = torque + normal.T @ lsq_linear(normal.T / scene.reach, -torque / scene.reach, bounds=bounds).x
    imbalance = np.hypot(np.linalg.norm(missing), np.linalg.norm(torque) / scene.reach) / weight
    return {
        "force_outside_cone": bool((~inside).any()),
        "imbalance": float(imbalance),
        "largest_force": float(size.max()),
    }


def epsilon(scene, contacts):
    """Upper bound on Ferrari and Canny's epsilon of the contacts as soft fingers.

    Epsilon is the smallest support of the convex hull of all wrenches that a press of one newton can exert; in each
    direction of wrench space the support is that of the best contact. Torques are about the middle of the contacts and
    divided by half their span, within a hand's lengths: parts far from the hand do not count. The search refines random directions by ever
    smaller random steps.
    """
    if not contacts:
        return {"epsilon": 0.0}
    inward = -np.array([contact["normal"] for contact in contacts])
    positions = np.array([contact["position"] for contact in contacts])
    span = np.linalg.norm(positions[:, None] - positions, axis=2).max()
    length = np.clip(span / 2, *HAND_LENGTHS)
    arm = (positions - positions.mean(axis=0)) / length
    twist = TORSION_RADIUS / length

    def support(directions):
        push, turn = directions[..., :3], directions[..., 3:]
        along = push[..., None, :] + np.cross(turn[..., None, :], arm)
        pressing = np.einsum("...ci,ci->...c", along, inward)
        sideways = np.einsum("...ci,...ci->...c", along, along) - pressing**2
        about = np.einsum("...i,ci->...c", turn, inward)
        reach = np.sqrt(np.maximum(sideways, 0.0) + (twist * about) ** 2)
        return (pressing + scene.friction * reach).max(axis=-1)

    random = np.random.default_rng(0)
    directions = random.normal(size=(4000, 6))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    best = directions[np.argsort(support(directions))[:24]]
    values = support(best)
    step = 0.3
    while step > 1e-3:
        tried = best[:, None] + step * random.normal(size=(len(best), 48, 6))
        tried /= np.linalg.norm(tried, axis=2, keepdims=True)
        reached = support(tried)
        choice = reached.argmin(axis=1)
        rows = np.arange(len(best))
        better = reached[rows, choice] < values
        best[better] = tried[rows, choice][better]
        values = np.minimum(values, reached[rows, choice])
        if better.mean() < 0.3:
            step *= 0.9
    return {"epsilon": float(max(0.0, values.min()))}


def fingers(hand, contacts):
    """Joint limits and stretched fingers."""
    angles, _, displaced = hand.angles()
    beyond = hand.beyond_limits()
    stretched = (np.abs(angles[1:, 1]) < STRETCHED) & (np.abs(angles[1:, 2]) < STRETCHED)
    touching = np.array([any(c["digit"] == name for c in contacts) for name in DIGITS[1:]])
    return {
        "beyond_limits": float(beyond),
        "limits_broken": bool(beyond > LIMIT_TOLERANCE or displaced > BONE_TOLERANCE),
        "displaced_joint": float(displaced),
        "stretched": int(stretched.sum()),
        "stretched_idle": int((stretched & ~touching).sum()),
    }


def contact_places(mesh, hand, contacts):
    """How far the contacts are from mesh and skin, and whether their normals are right."""
    if not contacts:
        return {"off_mesh": 0.0, "off_skin": 0.0, "faces_away": 0, "normal_wrong": 0}
    capsules, tags = hand.solids()
    points = np.array([contact["position"] for contact in contacts])
    off_mesh = mesh.closest(points)[0]
    off_skin, away, wrong = [], 0, 0
    for point, contact in zip(points, contacts):
        digit = DIGITS.index(contact["digit"]) if contact["digit"] in DIGITS else -1
        own = tags[:, 0] == digit
        if digit >= 0 and contact["phalanx"] in PHALANGES:
            own &= tags[:, 1] == PHALANGES.index(contact["phalanx"])
        part = capsules.subset(np.flatnonzero(own))
        distances = part.distances(point)[0]
        nearest = int(np.argmin(distances))
        off_skin.append(abs(distances[nearest]))
        axis = part.ends[nearest] - part.starts[nearest]
        along = np.clip(np.dot(point - part.starts[nearest], axis) / np.dot(axis, axis), 0.0, 1.0)
        away += np.dot(contact["normal"], part.starts[nearest] + along * axis - point) <= 0
        wrong += not is_normal(mesh, point, contact["normal"])
    return {
        "off_mesh": float(off_mesh.max()),
        "off_skin": float(max(off_skin)),
        "faces_away": int(away),
        "normal_wrong": int(wrong),
    }


def is_normal(mesh, point, normal):
    """Whether the surface has this normal at the point, in either direction: meshes may be inside out."""
    near = np.flatnonzero(np.linalg.norm(mesh.centres - point, axis=1) < mesh.radii + NORMAL_REACH)
    away = np.array([Mesh(mesh.triangles[t], [[0, 1, 2]]).closest([point])[0][0] for t in near])
    if (np.abs(mesh.normals[near[away < NORMAL_REACH]] @ normal) > np.cos(np.radians(NORMAL_ANGLE))).any():
        return True
    if presses_on_rim(mesh, point, normal):
        return True
    # A direction between normals is a sum of them with non-negative weights.
    at_edge = mesh.normals[near[away < EDGE_REACH]]
    return len(at_edge) > 1 and any(
        nnls(sign * at_edge.T, normal)[1] < np.sin(np.radians(NORMAL_ANGLE)) for sign in (1, -1)
    )


def presses_on_rim(mesh, point, normal):
    """Whether the point is on the rim of an open surface, and the normal at right angles to it."""
    rims = mesh.rims[0]
    if len(rims) == 0:
        return False
    start, along = rims[:, 0], rims[:, 1] - rims[:, 0]
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    share = np.clip(((point - start) * along).sum(axis=1) / squared, 0.0, 1.0)
    near = np.linalg.norm(point - start - share[:, None] * along, axis=1) < NORMAL_REACH
    return bool((np.abs(along[near] @ normal) < np.sqrt(squared[near]) * np.sin(np.radians(NORMAL_ANGLE))).any())


def giver_clearance(mesh, hand, giver):
    """Smallest distances from the hand to the giver's hand and forearm, and from the receiver's best forearm to all."""
    capsules, _ = hand.solids()
    points = surface_samples(mesh)[0]
    result = {"giver_hand": np.inf, "giver_forearm": np.inf}
    others = None
    if giver is not None:
        others, _ = giver.solids()
        result["giver_hand"] = float(clearance(capsules, others).min())
        # The request has no giver's forearm: assume that it is straight behind the wrist.
        result["giver_forearm"] = float(clearance(capsules, giver.forearm()).min())
    best = -np.inf
    for forearm in hand.forearms():
        gap = forearm.distances(points).min() if len(points) else np.inf
        if gap > best and others is not None:
            gap = min(gap, clearance(forearm, others).min(), clearance(forearm, giver.forearm()).min())
        best = max(best, gap)
        if best > 0.001:
            break
    result["own_forearm"] = float(best)
    result["giver_touched"] = bool(min(result["giver_hand"], result["giver_forearm"], best) < 0)
    return result


def self_clearance(hand):
    """The smallest distance between parts of the hand that are not joined: between digits, and from digits to the palm.

    Neighbouring proximal phalanges share the web at the knuckles, so only their outer halves count. Against the palm
    only the links beyond the middle joint count (of the thumb, the last phalanx).
    """
    capsules, tags = hand.solids()
    trimmed, _ = hand.solids()
    for row, (digit, phalanx) in enumerate(tags):
        if digit > 0 and phalanx == 0:
            middle, radius = trimmed.at(np.full(len(tags), 0.5))
            trimmed.starts[row], trimmed.start_radii[row] = middle[row], radius[row]
    trimmed = type(capsules)(trimmed.starts, trimmed.ends, trimmed.start_radii, trimmed.end_radii)
    gaps = clearance(trimmed, trimmed)
    least, worst, pair = np.inf, np.inf, ""
    metacarpals = range(15, 19)
    for a in range(15):
        for b in range(a + 1, 19):
            (first, link), (second, other) = tags[a], tags[b]
            if second < 0:
                considered = b in metacarpals and (link == 2 or (first > 0 and link == 1))
            else:
                # The thumb's metacarpal is in the palm, next to the index finger's root.
                rooted = first == 0 and link == 0 and other == 0
                considered = first != second and not rooted
            if not considered:
                continue
            excess = gaps[a, b] + (NEIGHBOURS_FLESH if first > 0 and second == first + 1 else FLESH)
            if excess < least:
                least, worst = excess, gaps[a, b]
                name = "palm" if second < 0 else f"{DIGITS[second]} {PHALANGES[other]}"
                pair = f"{DIGITS[first]} {PHALANGES[link]} - {name}"
    return {"self_clearance": float(worst), "self_collision": bool(least < 0), "closest_pair": pair}


def forbidden_distance(scene, hand):
    """Distance from the forbidden surface to the nearest part of the hand."""
    chosen = scene.mesh.samples(scene.forbidden)[0]
    if len(chosen) == 0:
        return {"forbidden_distance": np.inf}
    return {"forbidden_distance": float(hand.solids()[0].distances(chosen).min())}


def comfort(contacts, reported):
    """E of Eq. 4.6 computed from the forces, and how far the reply's E is from it."""
    totals = np.zeros(5)
    for contact in contacts:
        if contact["digit"] in DIGITS:
            totals[DIGITS.index(contact["digit"])] += np.linalg.norm(contact["force"])
    if totals.sum() <= 0:
        return {"comfort": np.nan, "comfort_error": np.inf}
    wanted = np.where(totals > 0, SHARES, 0)
    value = float(((wanted / wanted.sum() - totals / totals.sum()) ** 2).sum())
    return {"comfort": value, "comfort_error": abs(value - reported)}


def reported_margins(grasp):
    """The margins in the reply, if it has any."""
    margins = grasp.get("margins") or {}
    return {f"reported_{name}": value for name, value in margins.items()}


def reported_type(grasp):
    """The type in the reply ("" for none) and its confidence; nothing if the reply has no field for types."""
    if "type" not in grasp:
        return {}
    name = (grasp["type"] or "").lower().removeprefix("grasp_type_")
    confidence = grasp.get("type_confidence", grasp.get("typeConfidence"))
    return {"type": "" if name == "unspecified" else name, "type_confidence": float(confidence or 0.0)}


# Of these, the smaller value of both hands counts, and of others the larger.
LEAST = {
    "giver_hand",
    "giver_forearm",
    "own_forearm",
    "self_clearance",
    "forbidden_distance",
    "type_confidence",
    "reported_epsilon",
}
HANDEDNESS = ("right", "left")


def judge_both(scene, grasps):
    """All measures of a right and a left hand by name: forces and closure of both together, of others the worse.

    Nobody holds the object out, so each hand is judged as clear of the other as of a giver.
    """
    hands = [hand_of_reply(grasp) for grasp in grasps]
    rows = []
    for i, grasp in enumerate(grasps):
        beside = dataclasses.replace(scene, giver=hands[1 - i], asked_handedness=HANDEDNESS[i])
        rows.append(judge(beside, grasp))
    contacts = [contact for grasp in grasps for contact in in_object_frame(scene, grasp)[1]]
    return {
        **{name: worse(name, [row[name] for row in rows]) for name in rows[0] if name in rows[1]},
        **forces(scene, contacts, scene.rotation.inv().apply(scene.up)),
        **epsilon(scene, contacts),
    }


def worse(name, values):
    """The worse of both hands' values of a measure; of texts and of values that a reply omits, the first there is."""
    if any(value is None or isinstance(value, str) for value in values):
        return next((value for value in values if value), values[0])
    return min(values) if name in LEAST else max(values)
