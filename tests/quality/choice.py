"""How a hand takes an object, as people see it: from which side, by which dimension, and where along it.

The object's box is the smallest that holds it. A hand approaches halfway between its stretched fingers and its palm's
normal. Lengths are in metres, angles in degrees.

Sources. Feix, Bullock and Dollar 2014, Analysis of human grasping behavior: object characteristics and grasp type
(almost 10,000 grasps of two housekeepers and two machinists). Balasubramanian et al. 2012, Physical human interactive
guidance: identifying grasping principles from human-planned grasps (people align the hand with an object's principal
axes).
"""

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

import measures
import stance
from hand import WRIST

# An object is long if its longest side is this many times the next.
LONG = 1.6
# An approach within this angle of an axis goes along it; so do 1 - cos 45° = 29 % of all directions.
ALONG = 45.0
CHANCE = 100 * (1 - np.cos(np.radians(ALONG)))
# A side is as good as the smallest up to this ratio.
SMALLEST = 1.2
# Share of long things that people take end-on: 53 objects, nobody holding. In percent.
PEOPLE_END_ON = 34
# Largest number of the hull's faces that are tried as a face of the box.
DIRECTIONS = 250


def box_of(mesh):
    """Axes (rows, the longest first), sides and middle of the smallest box; computed once."""
    if not hasattr(mesh, "smallest_box"):
        mesh.smallest_box = smallest_box(mesh.vertices[np.unique(mesh.faces)])
    return mesh.smallest_box


def smallest_box(points):
    """Axes (rows, the longest first), sides and middle of the smallest box around points.

    The box has a face on a face of the convex hull, and may be slightly larger than one that has none. The axes of the
    frame and the principal axes are tried as well: a sheet has no hull.
    """
    try:
        hull = ConvexHull(points)
        points, normals = points[hull.vertices], np.unique(np.round(hull.equations[:, :3], 4), axis=0)
    except QhullError:
        normals = np.empty((0, 3))
    if len(normals) > DIRECTIONS:
        normals = normals[np.linspace(0, len(normals) - 1, DIRECTIONS).astype(int)]
    principal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    best, least = None, np.inf
    for normal in np.concatenate([np.eye(3), principal, normals]):
        axes = around(points, stance.unit(normal))
        sides = np.ptp(points @ axes.T, axis=0)
        # A millimetre keeps sheets from having no volume at all.
        volume = np.prod(sides + 0.001)
        if volume < least * (1 - 1e-6):
            best, least = (axes, sides), volume
    order = np.argsort(-best[1])
    axes, sides = best[0][order], best[1][order]
    along = points @ axes.T
    return axes, sides, (along.max(axis=0) + along.min(axis=0)) / 2 @ axes


def around(points, normal):
    """Axes of the smallest box with a face at right angles to the normal: it has a side on an edge of the outline."""
    first = stance.unit(np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))]))
    second = np.cross(normal, first)
    flat = np.stack([points @ first, points @ second], axis=1)
    try:
        outline = flat[ConvexHull(flat).vertices]
    except QhullError:
        # A sheet seen from its edge is a line.
        along = flat @ np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)[2][0]
        outline = flat[[np.argmin(along), np.argmax(along)]]
    edges = np.diff(np.concatenate([outline, outline[:1]]), axis=0)
    angles = np.unique(np.round(np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2), 5))
    across = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    spans = np.ptp(outline @ across.T, axis=0) * np.ptp(outline @ (across[:, ::-1] * [-1, 1]).T, axis=0)
    cosine, sine = across[np.argmin(spans)]
    return np.stack([cosine * first + sine * second, -sine * first + cosine * second, normal])


def folded(a, axis):
    """The angle between a direction and an axis, at most 90."""
    return float(np.degrees(np.arccos(np.clip(abs(np.dot(a, axis)), 0.0, 1.0))))


def from_side(approach, up):
    """Whether a hand comes from above, the side or beneath."""
    height = float(stance.angle(-np.asarray(approach), up))
    return "above" if height < ALONG else "beneath" if height > 180 - ALONG else "side"


def opposition(contacts):
    """The axis along which the contacts press most, from their normals and forces."""
    normals = np.array([contact["normal"] for contact in contacts])
    weights = np.linalg.norm([contact["force"] for contact in contacts], axis=1)
    return np.linalg.eigh((weights[:, None] * normals).T @ normals)[1][:, -1]


def judge(scene, grasp):
    """The measures of a grasp by name."""
    hand, contacts = measures.in_object_frame(scene, grasp)
    axes, sides, middle = box_of(scene.mesh)
    wrist = hand.rotations[WRIST]
    approach = wrist.apply([0.0, -(0.5**0.5), -(0.5**0.5)])
    up = scene.rotation.inv().apply(scene.up)
    row = {
        "held_out": scene.giver is not None,
        "long": bool(sides[0] >= LONG * sides[1]),
        "approach_to_axis": folded(approach, axes[0]),
        "palm_to_axis": folded(wrist.apply([0.0, -1.0, 0.0]), axes[0]),
        "forearm_to_axis": folded(stance.forearm_direction(hand), axes[0]),
        "wrist_to_axis": folded(stance.unit(hand.positions[WRIST] - middle), axes[0]),
        "approach_to_nearest_axis": min(folded(approach, axis) for axis in axes),
        "from_held": from_side(approach, up),
        "from_standing": from_side(approach, [0.0, 1.0, 0.0]),
    }
    if contacts:
        touched = np.mean([contact["position"] for contact in contacts], axis=0)
        row["offset_along"] = float(abs((touched - scene.centre_of_mass) @ axes[0]) / (sides[0] / 2))
        off = [folded(opposition(contacts), axis) for axis in axes]
        row["across_smallest"] = bool(sides[int(np.argmin(off))] <= SMALLEST * sides[2])
    return row


def share(values):
    """A share as text, with its counts."""
    values = list(values)
    return f"{100 * np.mean(values):.0f} % ({sum(values)} of {len(values)})" if values else "none"


def end_on(rows, name="approach_to_axis"):
    """Of the rows on long things, which ones go along the long axis."""
    return [row[name] < ALONG for row in rows if row["long"]]


def lines(found):
    """Lines of the table of targets: measure, target, figure, and whether it is met."""
    rows = [row for row in found if "long" in row]
    result = []
    for held_out, name, wanted in [
        (False, "long things taken end-on, nobody holding", f"≤ {PEOPLE_END_ON} %"),
        (True, "long things taken end-on, from a giver", "reported"),
    ]:
        taken = end_on(row for row in rows if row["held_out"] == held_out)
        if taken:
            met = None if held_out else 100 * np.mean(taken) <= PEOPLE_END_ON
            result.append((name, wanted, share(taken), None if met is None else bool(met)))
            where = share(end_on((row for row in rows if row["held_out"] == held_out), "wrist_to_axis"))
            result.append((name.replace("taken end-on", "with the wrist toward an end"), "reported", where, None))
    return result


def quartiles(values, unit):
    """Quartiles as text."""
    values = list(values)
    if not values:
        return "none"
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{low:.0f} / {middle:.0f} / {high:.0f}{unit}"


def nearest_by_chance():
    """Quartiles of the angle between a random direction and the nearest of three axes, as text."""
    directions = np.abs(Rotation.random(20000, rng=np.random.default_rng(0)).apply([0.0, 0.0, 1.0]))
    return quartiles(np.degrees(np.arccos(directions.max(axis=1))), "°")


def table(found):
    """Markdown table of the distributions, with nobody holding and from a giver, beside chance and people."""
    rows = [row for row in found if "long" in row]
    groups = [[row for row in rows if row["held_out"] == held_out] for held_out in (False, True)]
    text = ["| | nobody holding | from a giver | by chance | people |", "|---|--:|--:|--:|---|"]
    for name in ("approach", "palm", "forearm"):
        cells = [share(end_on(here, f"{name}_to_axis")) for here in groups]
        people = f"{PEOPLE_END_ON} % (people, 53 objects)" if name == "approach" else ""
        text.append(f"| long things taken end-on, by the {name} | {' | '.join(cells)} | {CHANCE:.0f} % | {people} |")
    cells = [share(end_on(here, "wrist_to_axis")) for here in groups]
    text.append(f"| long things with the wrist toward an end, from the middle | {' | '.join(cells)} | | |")
    for name in ("approach", "palm", "forearm"):
        cells = [quartiles((row[f"{name}_to_axis"] for row in here if row["long"]), "°") for here in groups]
        # The cosine of the angle between a random direction and an axis is spread evenly.
        text.append(f"| {name} to the long axis, quartiles | {' | '.join(cells)} | 41 / 60 / 76° | |")
    offsets = [[100 * row["offset_along"] for row in here if row["long"] and "offset_along" in row] for here in groups]
    cells = [quartiles(values, " %") for values in offsets]
    text.append(f"| contacts off the centre of mass, of half the length | {' | '.join(cells)} | | |")
    cells = [quartiles((row["approach_to_nearest_axis"] for row in here), "°") for here in groups]
    cells += [nearest_by_chance(), "aligned (Balasubramanian et al. 2012)"]
    text.append(f"| approach to the box's nearest axis, quartiles | {' | '.join(cells)} |")
    cells = [share(row["across_smallest"] for row in here if "across_smallest" in row) for here in groups]
    text.append(f"| pressed across the smallest dimension | {' | '.join(cells)} | | 94 % (Feix et al. 2014) |")
    for key, name in [("from_held", "as held"), ("from_standing", "as it stands")]:
        for side, chance in [("above", 15), ("side", 71), ("beneath", 15)]:
            cells = [share(row[key] == side for row in here) for here in groups]
            text.append(f"| {name}, taken from {side} | {' | '.join(cells)} | {chance} % | |")
    return "\n".join(text)
