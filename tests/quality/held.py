"""The shape of the part of an object that a hand holds: what a person would call it where the hand touches.

The part's long direction is the one along which the surface near the contacts does not curve. Slices across it, one per
touching digit, give its width and depth; how far the slices go on gives its length. Lengths are in metres.
"""

from dataclasses import dataclass, field

import numpy as np

import grip as grips
from grip import falls, rises

# Surface this near to a contact tells how the part curves, in metres.
CURVE_REACH = 0.018
# Half the thickness of a slice, and the largest gap within a piece of it.
SLICE, LINK = 0.005, 0.006
# How far the part is followed to each side.
REACH = 0.12
# A normal this close to the radius, as a cosine, is one of a round outline.
ROUND = np.cos(np.radians(25))


@dataclass
class Shape:
    """What is held, with lengths in metres and memberships from 0 to 1."""

    # Along the long direction, and across it: the larger and the smaller side of a slice.
    length: float
    width: float
    depth: float
    # Unit vector of the long direction.
    along: np.ndarray
    # Share of a slice's outline that faces away from its middle: 1 for a circle.
    roundness: float
    # Distance between thumb (or palm) and fingers, along the normal of the contacts.
    opening: float
    # Membership of each class: bead, ball, rod, strip, plate, disk, block, edge.
    classes: dict = field(default_factory=dict)

    @property
    def thickness(self):
        """The mean of width and depth: the diameter of a round part."""
        return (self.width + self.depth) / 2

    @property
    def name(self):
        """The class that fits best."""
        return max(self.classes, key=self.classes.get)

    def of(self, *names):
        """How well the best of these classes fits."""
        return max(self.classes[name] for name in names)


def shape_of(mesh, grip, contacts):
    """The shape of what the hand holds."""
    points, normals, tree = grips.coarse_samples(mesh)
    spots = grip.places[np.isfinite(grip.places).all(axis=1)]
    if len(spots) == 0:
        spots = grip.palm_middle[None]
    near = np.unique(np.concatenate([patch(points, normals, tree, spot) for spot in spots]))
    along = long_direction(points, normals, tree, near, spots)
    slices = [slice_at(points, normals, along, spot) for spot in spots]
    width, depth, roundness = np.median([s[:3] for s in slices], axis=0)
    centre = np.mean([s[3] for s in slices], axis=0)
    length, beyond = extent(points, along, centre, width)
    opening = opening_of(grip, contacts)
    shape = Shape(length, width, depth, along, roundness, opening)
    ball, _ = fitted(points[near], normals[near], 10, 16)
    # A handle on a round body makes the slice oblong, but not what the hand feels.
    across = np.linalg.svd(along[None])[2][1:]
    facing = normals[near] @ across.T
    sideways = np.linalg.norm(facing, axis=1) > 0.5
    is_round, radius = fitted(points[near[sideways]] @ across.T, facing[sideways], 6, 11)
    if is_round > shape.roundness:
        shape.roundness, shape.width, shape.depth = is_round, 2 * radius, 2 * radius
    ball = max(ball, bulge(normals[near] @ along, shape.width) * rises(shape.roundness, 0.5, 0.75))
    # An end that the fingers reach over from beyond it: a cap, a lid, the neck of a bottle from above.
    toward = 1 if along @ grip.axes[2] < 0 else -1
    level = np.median((spots - centre) @ along) * toward
    end_on = rises(abs(along @ grip.axes[2]), 0.6, 0.8) * falls(beyond[toward] - level, 0.015, 0.03)
    shape.classes = memberships(shape, ball, end_on)
    return shape


def patch(points, normals, tree, spot):
    """Indices of the surface near a contact that hangs together with it."""
    near = np.array(tree.query_ball_point(spot, CURVE_REACH), int)
    if len(near) < 4:
        return tree.query(spot, k=min(8, len(points)))[1]
    # The far side of a wall is none of the fingers' business.
    nearest = near[np.argmin(np.linalg.norm(points[near] - spot, axis=1))]
    near = near[normals[near] @ normals[nearest] > 0.3]
    return near[connected(points[near], spot)]


def long_direction(points, normals, tree, near, spots):
    """The direction along which the surface near the contacts does not curve; on flat parts, that of their length."""
    spread, axes = np.linalg.eigh(normals[near].T @ normals[near] / len(near))
    if spread[1] - spread[0] > 0.02 or spread[1] > 0.06:
        return axes[:, 0]
    wide = tree.query_ball_point(spots.mean(axis=0), 0.06)
    here = points[wide if len(wide) > 8 else near]
    flat = (here - here.mean(axis=0)) @ axes[:, :2]
    return axes[:, :2] @ np.linalg.eigh(flat.T @ flat)[1][:, 1]


def slice_at(points, normals, along, spot):
    """Width, depth, roundness and centre of the piece of a slice across `along` that a contact touches."""
    frame = np.linalg.svd(along[None])[2][1:]
    here = np.flatnonzero(np.abs((points - spot) @ along) < SLICE)
    if len(here) < 3:
        return 0.0, 0.0, 1.0, spot
    flat = (points[here] - spot) @ frame.T
    piece = connected(flat, np.zeros(2))
    flat, across = flat[piece], normals[here[piece]] @ frame.T
    best = None
    for angle in np.radians(np.arange(0, 90, 5)):
        turned = flat @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        sides = np.ptp(turned, axis=0)
        if best is None or sides.prod() < best[0].prod():
            best = sides, (turned.max(axis=0) + turned.min(axis=0)) / 2, angle
    sides, middle, angle = best
    middle = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ middle
    radial = flat - middle
    cosine = np.abs(np.einsum("pi,pi->p", radial, across))
    cosine /= np.maximum(np.linalg.norm(radial, axis=1) * np.linalg.norm(across, axis=1), 1e-9)
    side = np.linalg.norm(across, axis=1) > 0.5
    roundness = float((cosine[side] > ROUND).mean()) if side.any() else 0.0
    return max(sides), min(sides), roundness, spot + middle @ frame


def connected(points, seed):
    """Indices of the points that hang together with the one nearest to the seed."""
    labels = grips.linked(points, LINK)
    return np.flatnonzero(labels == labels[np.argmin(np.linalg.norm(points - seed, axis=1))])


def extent(points, along, centre, width):
    """How long the part is, and how far it goes on to each side of the centre (by the sign of the direction)."""
    offset = points - centre
    level = offset @ along
    away = np.linalg.norm(offset - level[:, None] * along, axis=1)
    inside = (away < 0.6 * width + 0.004) & (np.abs(level) < REACH)
    filled = np.unique(np.round(level[inside] / SLICE).astype(int))
    far = {}
    for sign in (1, -1):
        reached = 0
        # One empty bin is a gap between samples, not the end.
        while {sign * (reached + 1), sign * (reached + 2)} & set(filled):
            reached += 1
        far[sign] = reached * SLICE
    return far[1] + far[-1], far


def bulge(slopes, width):
    """How surely a round part also curves along itself under the contacts, as the bowl of a wine glass does.

    `slopes` are the sines of the angles between the normals and the slice.
    """
    # Steeper surface is the end of the part.
    slopes = slopes[np.abs(slopes) < 0.7]
    if len(slopes) == 0:
        return 0.0
    spread = np.ptp(np.quantile(slopes, [0.05, 0.95]))
    return rises(spread, 0.3, 0.5) * rises(width, 0.03, 0.04) * falls(width, 0.12, 0.15)


def opening_of(grip, contacts):
    """Distance between what opposes: the thumb, or else the palm, and the fingers."""
    fingers = grip.middle_of([1, 2, 3, 4])
    thumb = grip.middle_of([0])
    first = thumb if thumb is not None else grip.palm_middle
    if fingers is None:
        return 0.0
    pressing = np.array([c["normal"] * np.sqrt(np.linalg.norm(c["force"])) for c in contacts]).reshape(-1, 3)
    if not pressing.any():
        return float(np.linalg.norm(first - fingers))
    axis = np.linalg.eigh(pressing.T @ pressing)[1][:, 2]
    return float(abs((first - fingers) @ axis))


def fitted(points, normals, good, bad):
    """How well points with normals fit a ball or circle of at most 7.5 cm, and its radius.

    On a perfect one every normal is along the radius; the mean angle between them may be `good` degrees, but not `bad`.
    """
    if len(points) <= points.shape[1] + 1:
        return 0.0, 0.0
    system = np.column_stack([2 * points, np.ones(len(points))])
    solution = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0]
    centre = solution[:-1]
    radius = np.sqrt(max(solution[-1] + centre @ centre, 1e-12))
    radial = points - centre
    cosine = np.abs(np.einsum("pi,pi->p", radial, normals))
    cosine /= np.maximum(np.linalg.norm(radial, axis=1) * np.linalg.norm(normals, axis=1), 1e-9)
    angle = np.degrees(np.arccos(np.minimum(cosine, 1))).mean()
    return falls(angle, good, bad) * falls(radius, 0.06, 0.075), float(radius)


def memberships(shape, ball, end_on):
    """How well each class fits."""
    length, width, depth = shape.length, max(shape.width, 1e-4), shape.depth
    smallest, middle, largest = np.sort([min(length, 2 * REACH), width, depth])
    elongation, flatness = length / width, depth / width
    is_round = rises(shape.roundness, 0.5, 0.75)
    rod = rises(elongation, 1.1 - 0.3 * is_round, 1.8 - 0.5 * is_round) * rises(flatness, 0.2, 0.4)
    # A ball goes on in no direction.
    rod *= falls(width, 0.1, 0.13) * (1 - 0.8 * ball)
    strip = rises(elongation, 1.5, 2.2) * falls(flatness, 0.35, 0.5) * falls(width, 0.04, 0.055)
    plate = falls(smallest / max(middle, 1e-4), 0.3, 0.5) * falls(smallest, 0.035, 0.05)
    disk = is_round * rises(flatness, 0.6, 0.8) * falls(width, 0.12, 0.15)
    disk *= max(falls(length / width, 0.6, 1.0), end_on)
    compact = falls(elongation, 1.5, 2.2) * rises(elongation, 0.3, 0.5) * rises(flatness, 0.3, 0.5)
    through = rises(min(smallest, middle) / max(shape.opening, 1e-4), 2.0, 3.0) * falls(shape.opening, 0.012, 0.02)
    return {
        "bead": falls(largest, 0.024, 0.034),
        "ball": ball,
        "rod": rod,
        "strip": strip,
        "plate": plate,
        "disk": disk,
        "block": compact * falls(shape.roundness, 0.55, 0.8),
        "edge": through,
    }
