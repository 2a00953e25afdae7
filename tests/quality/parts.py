"""Parts of objects that matter to a receiver: handles, sharp edges and points; and power for heavy things.

Handles are labelled by the groups of the everyday objects' files, or by formulas on positions in the object's frame.
Sharp features are found in the mesh. Lengths are in metres, angles in degrees.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

import grip as grips
import measures
from hand import DIGITS
from solids import Mesh

# Groups that are the handle of an everyday object.
BY_GROUP = {
    "axe": ["handle"],
    "backpack": ["loop"],
    "basket": ["handle"],
    "broom": ["handle"],
    "bucket": ["bail", "grip"],
    "crutch": ["grip"],
    "drill": ["handle"],
    "fishing-rod": ["grip"],
    "fork": ["handle"],
    "golf-club": ["grip"],
    "hair-brush": ["handle"],
    "hair-dryer": ["handle"],
    "hammer": ["handle"],
    "iron": ["handle"],
    "kettle": ["handle"],
    "kitchen-knife": ["handle"],
    "kitchen-scissors": ["handles"],
    "ladle": ["handle"],
    "lunch-box": ["handle"],
    "mug": ["handle"],
    "paint-brush": ["handle"],
    "pan": ["handle"],
    "peeler": ["handle"],
    "pliers": ["handles"],
    "rake": ["handle"],
    "saw": ["handle"],
    "screwdriver": ["handle"],
    "shopping-bag": ["loops"],
    "shovel": ["shaft", "grip"],
    "spatula": ["handle"],
    "spoon": ["handle"],
    "suitcase": ["handle"],
    "sword": ["hilt"],
    "table-knife": ["handle"],
    "tennis-racket": ["handle"],
    "toolbox": ["handle"],
    "toothbrush": ["handle"],
    "trowel": ["handle"],
    "umbrella-closed": ["crook"],
    "umbrella-open": ["handle"],
    "walking-stick": ["crook"],
    "watering-can": ["handle"],
    "whisk": ["handle"],
}
# Formulas on positions (rows of x, y, z) that hold on the handle.
BY_FORMULA = {
    # Outside the cup, a cylinder of 41 mm about a line parallel to z.
    "osim_mug": lambda p: np.hypot(p[:, 0] + 0.0169, p[:, 1]) > 0.0425,
    # The head ends at x = -78 mm.
    "osim_hammer": lambda p: p[:, 0] > -0.077,
    # The blade is thin and begins at y = -32 mm.
    "osim_knife": lambda p: p[:, 1] < -0.032,
    # The head with the bristles is at the other end.
    "osim_toothbrush": lambda p: p[:, 0] > -0.045,
    # The loops are above the pivot.
    "osim_scissors": lambda p: p[:, 1] > 0.005,
    # The thin end with the knob, the bar between the weights, and the ends beside the roll.
    "baseball-bat": lambda p: p[:, 1] < -0.15,
    "dumbbell": lambda p: (np.hypot(p[:, 1], p[:, 2]) < 0.02) & (np.abs(p[:, 0]) < 0.07),
    "rolling-pin": lambda p: (np.hypot(p[:, 1], p[:, 2]) < 0.02) & (np.abs(p[:, 0]) > 0.13),
}
# Room for a finger beside the giver's hand, in metres.
FINGER = 0.012
# A contact this near to a sample of the handle is on it: as far as samples are apart.
BENEATH = 0.0025
# An edge cuts if its sides meet at less than this angle, over this length.
SHARP_ANGLE, SHARP_LENGTH = 30.0, 0.010
# A worn or coarsely scanned edge cuts, too: at most BLUNT thick at the end and thicker behind it, within EDGE_REACH, as
# if its sides met at an angle from the first to the second in WEDGE. A card's sides do not meet.
BLUNT, WEDGE, EDGE_REACH = 0.0015, (5.0, 30.0), 0.005
# A point pierces if the surface within TIP_REACH of it lies within a cone of this half-angle, but for TIP_SLACK.
TIP_ANGLE, TIP_REACH, TIP_SLACK = 20.0, 0.005, 0.0003
# A contact this near to a sharp feature is on it; surface this far from it is safe, and so long a safe piece is enough.
ON_SHARP, SAFE, ENOUGH = 0.002, 0.005, 0.06
# Digits that hold heavy things, unless the palm does.
MANY_DIGITS = 4


def judge(name, scene, grasp):
    """The measures of a grasp that depend on the object's parts."""
    _, contacts = measures.in_object_frame(scene, grasp)
    inverse = scene.rotation.inv()
    giver = scene.giver and scene.giver.moved(inverse, -inverse.apply(scene.translation))
    spots = np.array([contact["position"] for contact in contacts]).reshape(-1, 3)
    digits = {contact["digit"] for contact in contacts}
    return {
        "mass_kg": scene.mass,
        **on_handle(name, scene.mesh, spots, giver),
        **sharpness(scene, spots, giver),
        "palm_or_four": bool(digits - set(DIGITS)) or len(digits) >= MANY_DIGITS,
    }


def has_handle(name):
    """Whether a handle is labelled on the object."""
    return name in BY_GROUP or name in BY_FORMULA


def handle_samples(name, mesh):
    """Samples of the handle's surface, evenly spread, that are not inside another part of the object."""
    if not hasattr(mesh, "handle"):
        if name in BY_FORMULA:
            points = spread(mesh)
            mesh.handle = points[BY_FORMULA[name](points)]
        else:
            own = np.isin(mesh.groups, BY_GROUP[name])
            points = spread(Mesh(mesh.vertices, mesh.faces[own]))
            others = Mesh(mesh.vertices, mesh.faces[~own])
            boxed = np.flatnonzero(((points > others.low) & (points < others.high)).all(axis=1))
            hidden = boxed[np.abs(others.winding(points[boxed])) > 0.5]
            mesh.handle = np.delete(points, hidden, axis=0)
    return mesh.handle


def spread(mesh):
    """Samples of a surface, about as many per area everywhere."""
    return grips.coarse_samples(mesh)[0]


def from_giver(points, giver):
    """Distance of each point to the giver's hand; infinite without one."""
    if giver is None or len(points) == 0:
        return np.full(len(points), np.inf)
    return giver.solids()[0].distances(points).min(axis=1)


def on_handle(name, mesh, spots, giver):
    """How much of the handle the giver leaves, and how many of the contacts are on it; nothing without a handle."""
    if not has_handle(name) or len(spots) == 0:
        return {}
    handle = handle_samples(name, mesh)
    return {
        "handle_free": float((from_giver(handle, giver) > FINGER).mean()),
        "on_handle": float((cKDTree(handle).query(spots)[0] < BENEATH).mean()),
    }


def sharp_edges(mesh):
    """The ends of the edges that cut: an array of shape (n, 2, 3)."""
    places, merged = np.unique(np.round(mesh.vertices, 6), axis=0, return_inverse=True)
    corners = merged.ravel()[mesh.faces]
    pairs = np.concatenate([corners[:, [i, (i + 1) % 3]] for i in range(3)])
    owners = np.tile(np.arange(len(corners)), 3)
    forward = pairs[:, 0] < pairs[:, 1]
    edges, of_edge, counts = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True, return_counts=True)
    of_edge = of_edge.ravel()
    # Only edges between two triangles that are wound alike have an inside.
    left, right = np.full(len(edges), -1), np.full(len(edges), -1)
    left[of_edge[forward]], right[of_edge[~forward]] = owners[forward], owners[~forward]
    chosen = np.flatnonzero((counts == 2) & (left >= 0) & (right >= 0) & (edges[:, 0] != edges[:, 1]))
    left, right = left[chosen], right[chosen]
    solid = np.minimum(mesh.areas[left], mesh.areas[right]) > 1e-12
    # The interior angle of a ridge is 180 degrees less the angle between the normals; a groove's is more than 180.
    cosine = np.einsum("ei,ei->e", mesh.normals[left], mesh.normals[right])
    ridge = np.einsum("ei,ei->e", mesh.centres[right] - mesh.centres[left], mesh.normals[left]) < 0
    # Meshes that are inside out turn ridges into grooves.
    ridge = ridge if enclosed_volume(mesh) >= 0 else ~ridge
    chosen = chosen[solid & ridge & (cosine < -np.cos(np.radians(SHARP_ANGLE)))]
    if len(chosen) == 0:
        return np.empty((0, 2, 3))
    ends = edges[chosen]
    graph = coo_matrix((np.ones(len(ends)), ends.T), shape=(len(places), len(places)))
    labels = connected_components(graph, directed=False)[1][ends[:, 0]]
    lengths = np.linalg.norm(places[ends[:, 1]] - places[ends[:, 0]], axis=1)
    total = np.bincount(labels, weights=lengths)[labels]
    return places[ends[total >= SHARP_LENGTH]]


def worn_edges(mesh):
    """Points on edges that cut although no two triangles meet sharply: the ends of wedges."""
    points, _, tree = grips.coarse_samples(mesh)
    fine = measures.surface_samples(mesh)[0]
    near_fine, found = cKDTree(fine), []
    for point, near in zip(points, tree.query_ball_point(points, EDGE_REACH)):
        # At the end of a plate all surface is to one side.
        if np.linalg.norm(points[near].mean(axis=0) - point) < 0.15 * EDGE_REACH:
            continue
        offset = fine[near_fine.query_ball_point(point, EDGE_REACH)] - point
        inward = offset.mean(axis=0) / max(np.linalg.norm(offset.mean(axis=0)), 1e-9)
        flat = offset - np.outer(offset @ inward, inward)
        # Across the plate: of the two directions at right angles to `inward`, that in which it is thin.
        across = np.linalg.eigh(flat.T @ flat + np.outer(inward, inward))[1][:, 0]
        depth = offset @ inward - (offset @ inward).min()
        first, last = depth < 0.3 * EDGE_REACH, (depth > 0.6 * EDGE_REACH) & (depth < 0.9 * EDGE_REACH)
        if not last.any() or -(offset @ inward).min() > 0.2 * EDGE_REACH:
            continue
        thin, thick = np.ptp(offset[first] @ across), np.ptp(offset[last] @ across)
        angle = np.degrees(2 * np.arctan2((thick - thin) / 2, 0.6 * EDGE_REACH))
        if thin < BLUNT and WEDGE[0] < angle < WEDGE[1]:
            found.append(point)
    found = np.array(found).reshape(-1, 3)
    kept = [piece for piece in pieces(found, EDGE_REACH) if length_of(piece) >= SHARP_LENGTH]
    return np.concatenate([np.empty((0, 3)), *kept])


def enclosed_volume(mesh):
    """Six times the volume that the surface encloses; negative if it is inside out."""
    a, b, c = mesh.triangles[:, 0], mesh.triangles[:, 1], mesh.triangles[:, 2]
    return float(np.einsum("ti,ti->", a, np.cross(b, c)))


def tips(mesh):
    """The points that pierce: an array of shape (n, 3)."""
    surface = measures.surface_samples(mesh)[0]
    tree, found = cKDTree(surface), []
    for vertex in np.unique(np.round(mesh.vertices[np.unique(mesh.faces)], 6), axis=0):
        offset = surface[tree.query_ball_point(vertex, TIP_REACH)] - vertex
        middle = offset.mean(axis=0) if len(offset) else np.zeros(3)
        # All surface is to one side of a point; on a flat part its middle is the point itself.
        if np.linalg.norm(middle) < 0.3 * TIP_REACH:
            continue
        along = offset @ (middle / np.linalg.norm(middle))
        across = np.sqrt(np.maximum((offset**2).sum(axis=1) - along**2, 0.0))
        fits = across <= np.maximum(along, 0.0) * np.tan(np.radians(TIP_ANGLE)) + TIP_SLACK
        if fits.all() and along.min() > -TIP_SLACK:
            found.append(vertex)
    return np.array(found).reshape(-1, 3)


def sharp_features(mesh):
    """Edges that cut and points that pierce, as segments, found once; those of points have no length."""
    if not hasattr(mesh, "sharp"):
        points = np.concatenate([tips(mesh), worn_edges(mesh)])
        mesh.sharp = np.concatenate([sharp_edges(mesh), np.stack([points, points], axis=1)])
    return mesh.sharp


def from_segments(points, segments):
    """Distance of each point to the nearest of some segments."""
    result = np.full(len(points), np.inf)
    for start, end in segments:
        line = end - start
        share = np.clip((points - start) @ line / max(line @ line, 1e-18), 0.0, 1.0)
        result = np.minimum(result, np.linalg.norm(points - start - share[:, None] * line, axis=1))
    return result


def sharpness(scene, spots, giver):
    """How many contacts are on sharp edges or points, and whether the object offers enough surface elsewhere."""
    sharp = sharp_features(scene.mesh)
    if len(sharp) == 0:
        return {"sharp_contacts": 0, "has_sharp": False, "offers_elsewhere": True}
    count = int((from_segments(spots, sharp) < ON_SHARP).sum())
    points = spread(scene.mesh)
    safe = points[(from_segments(points, sharp) > SAFE) & (from_giver(points, giver) > FINGER)]
    if len(scene.forbidden) and len(safe):
        safe = safe[cKDTree(scene.mesh.samples(scene.forbidden)[0]).query(safe)[0] > measures.FORBIDDEN]
    return {"sharp_contacts": count, "has_sharp": True, "offers_elsewhere": longest_piece(safe) >= ENOUGH}


def longest_piece(points):
    """Length of the longest piece of surface."""
    return max((length_of(piece) for piece in pieces(points, 0.006)), default=0.0)


def pieces(points, link):
    """The points in sets that hang together over gaps of at most `link`."""
    if len(points) == 0:
        return []
    labels = grips.linked(points, link)
    return np.split(points[np.argsort(labels, kind="stable")], np.cumsum(np.bincount(labels))[:-1])


def length_of(points):
    """Extent of points along their main axis."""
    centred = points - points.mean(axis=0)
    return float(np.ptp(centred @ np.linalg.eigh(centred.T @ centred)[1][:, 2]))
