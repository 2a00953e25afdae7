"""The features of a grasp: which parts of the hand touch, from which side, and how the thumb opposes the fingers.

Everything comes from the joint poses with radii, the contacts of the reply and the object's surface, in the object's
frame. Lengths are in metres, angles in degrees. Memberships run from 0 to 1.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from hand import CHAINS, DIGITS, PALM, PHALANGES, WRIST

# Skin touches up to the first distance from the surface, and certainly does not from the second on. Up to the third one
# cannot see whether it touches.
TOUCH, APART, UNSEEN = 0.0005, 0.004, 0.002
# The palm's flesh gives way more than the capsules show.
PALM_TOUCH, PALM_APART = 0.002, 0.010
# Distance between the samples of the surface.
SPACING = 0.0025


def rises(value, low, high):
    """0 up to `low`, 1 from `high`, straight between."""
    return float(np.clip((value - low) / (high - low), 0.0, 1.0))


def falls(value, low, high):
    """1 up to `low`, 0 from `high`, straight between."""
    return 1.0 - rises(value, low, high)


@dataclass
class Grip:
    """The features of one grasp."""

    # Of each digit, thumb first: how surely it touches, and each of its phalanges.
    touch: np.ndarray
    phalanges: np.ndarray
    palm: float
    # Whether it surely touches, and does not only seem to.
    palm_sure: bool
    # Distance from the palm's skin to the surface.
    palm_gap: float
    # Of each digit: where it touches (NaN where it does not), and the direction from the bone to there in the frame of
    # the phalanx: palmar, radial (toward the thumb's side) and distal.
    places: np.ndarray
    sides: np.ndarray
    # Of each digit: its direction at the last phalanx, and how much it is bent at the knuckle and beyond it.
    pointing: np.ndarray
    bends: np.ndarray
    # Palmar, radial and distal directions of the palm, and the middle of the palm.
    axes: np.ndarray
    palm_middle: np.ndarray
    # Of each digit: whether its phalanges pass through a loop of the object.
    looped: np.ndarray

    # The fewest and the most fingers that a person may see touch.
    fingers_between: tuple

    @property
    def fingers(self):
        """How many fingers touch, from 0 to 4; a finger close to touching counts partly."""
        return float(self.touch[1:].sum())

    def middle_of(self, digits):
        """Mean of the places where these digits touch, or None."""
        chosen = [d for d in digits if self.touch[d] > 0.5 and np.isfinite(self.places[d]).all()]
        return self.places[chosen].mean(axis=0) if chosen else None


def coarse_samples(mesh):
    """Samples of the surface, one per cell so that their number goes with the area; their normals and a tree."""
    if not hasattr(mesh, "coarse"):
        points, owners = mesh.sampled if hasattr(mesh, "sampled") else mesh.samples()
        mesh.sampled = points, owners
        # Both sides of a thin wall stay: cells tell normals apart.
        side = np.argmax(np.abs(mesh.normals[owners]), axis=1)
        signs = np.sign(mesh.normals[owners][np.arange(len(owners)), side])
        keys = np.column_stack([np.floor(points / SPACING), side, signs]).astype(np.int64)
        kept = np.unique(keys, axis=0, return_index=True)[1]
        mesh.coarse = points[kept], mesh.normals[owners[kept]], cKDTree(points[kept])
    return mesh.coarse


def linked(points, link):
    """A label for each point; points that hang together over gaps of at most `link` have the same."""
    pairs = cKDTree(points).query_pairs(link, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    return connected_components(graph, directed=False)[1]


def palm_axes(hand):
    """Palmar, radial and distal directions of the palm as rows."""
    palmar, distal = hand.rotations[PALM].apply([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    radial = np.cross(palmar, distal) * (-1.0 if hand.handedness == "right" else 1.0)
    return np.stack([palmar, radial, distal])


def read(mesh, hand, contacts):
    """The features of a grasp."""
    points = coarse_samples(mesh)[0]
    low, high = hand.positions.min(axis=0) - 0.03, hand.positions.max(axis=0) + 0.03
    near = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
    capsules, tags = hand.solids()
    fine = mesh.sampled[0]
    fine = fine[((fine > low) & (fine < high)).all(axis=1)]
    gaps = capsules.distances(fine) if len(fine) else np.full((1, len(tags)), np.inf)
    radial_sign = 1.0 if hand.handedness == "left" else -1.0
    sure, perhaps = np.zeros(5, bool), np.zeros(5, bool)
    phalanges, places, sides = np.zeros((5, 3)), np.full((5, 3), np.nan), np.zeros((5, 3))
    pointing, bends = np.zeros((5, 3)), np.zeros((5, 2))
    for digit, chain in enumerate(CHAINS):
        touched = []
        for phalanx in range(3):
            row = np.flatnonzero((tags == (digit, phalanx)).all(axis=1))[0]
            gap = gaps[:, row].min()
            phalanges[digit, phalanx] = falls(gap, TOUCH, APART)
            sure[digit] |= gap < 0
            perhaps[digit] |= gap < UNSEEN
            if phalanges[digit, phalanx] > 0.5:
                touched.append((row, fine[np.argmin(gaps[:, row])], 1.0))
        for contact in contacts:
            if contact["digit"] == DIGITS[digit]:
                phalanx = PHALANGES.index(contact["phalanx"])
                row = np.flatnonzero((tags == (digit, phalanx)).all(axis=1))[0]
                phalanges[digit, phalanx] = 1.0
                sure[digit] = perhaps[digit] = True
                # Pressing contacts say more about the opposition than mere touches.
                touched.append((row, contact["position"], 1.0 + 3.0 * np.linalg.norm(contact["force"])))
        if touched:
            rows, spots, weights = (np.array(column) for column in zip(*touched))
            places[digit] = np.average(spots, axis=0, weights=weights)
            outward = []
            for row, spot in zip(rows, spots):
                along = np.clip((spot - capsules.starts[row]) @ capsules.directions[row], 0, capsules.lengths[row])
                away = spot - capsules.starts[row] - along * capsules.directions[row]
                local = hand.rotations[chain[tags[row, 1]]].inv().apply(away / max(np.linalg.norm(away), 1e-9))
                outward.append([-local[1], radial_sign * local[0], -local[2]])
            sides[digit] = np.average(outward, axis=0, weights=weights)
        lines = [hand.positions[b] - hand.positions[a] for a, b in zip(chain, chain[1:])]
        lines = [line / max(np.linalg.norm(line), 1e-9) for line in lines]
        pointing[digit] = lines[2]
        bends[digit, 1] = np.degrees(np.arccos(np.clip(lines[0] @ lines[2], -1, 1)))
        root = hand.positions[chain[0]] - hand.positions[WRIST if digit == 0 else chain[0] - 1]
        bends[digit, 0] = np.degrees(np.arccos(np.clip(root @ lines[0] / max(np.linalg.norm(root), 1e-9), -1, 1)))
    of_palm = tags[:, 0] < 0
    palm_gap = float(gaps[:, of_palm].min())
    palm = falls(palm_gap, PALM_TOUCH, PALM_APART)
    palm_sure = palm_gap < 0 or any(contact["digit"] not in DIGITS for contact in contacts)
    palm = 1.0 if palm_sure else palm
    axes = palm_axes(hand)
    return Grip(
        touch=phalanges.max(axis=1),
        phalanges=phalanges,
        palm=palm,
        palm_sure=palm_sure,
        palm_gap=palm_gap,
        places=places,
        sides=sides,
        pointing=pointing,
        bends=bends,
        axes=axes,
        palm_middle=hand.positions[[11, 12, 16, 17]].mean(axis=0),
        looped=loops(hand, points[near]),
        fingers_between=(int(sure[1:].sum()), int(perhaps[1:].sum())),
    )


def loops(hand, points, reach=0.03, sectors=8):
    """Of each digit, whether the surface surrounds a phalanx: a finger in the loop of scissors."""
    result = np.zeros(5, bool)
    tree = cKDTree(points) if len(points) else None
    for digit, chain in enumerate(CHAINS):
        for a, b in zip(chain, chain[1:]):
            start, line = hand.positions[a], hand.positions[b] - hand.positions[a]
            length = np.linalg.norm(line)
            if tree is None or length < 1e-6:
                continue
            line /= length
            for share in (0.25, 0.5, 0.75):
                centre = start + share * length * line
                around = points[tree.query_ball_point(centre, reach)] - centre
                around = around[np.abs(around @ line) < 0.006]
                side = np.cross(line, np.eye(3)[np.argmin(np.abs(line))])
                side /= np.linalg.norm(side)
                angle = np.arctan2(around @ np.cross(line, side), around @ side)
                filled = np.unique(((angle + np.pi) / (2 * np.pi) * sectors).astype(int) % sectors)
                result[digit] |= len(filled) == sectors
    return result


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
    """The held part, with lengths in metres and memberships from 0 to 1."""

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
    """The shape of the held part."""
    points, normals, tree = coarse_samples(mesh)
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
    # A handle on a round body makes the slice oblong, but not the part in the hand.
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
    # The far side of a wall is not under the fingers.
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
    labels = linked(points, LINK)
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
    """Distance between the opposed sides: the thumb, or else the palm, and the fingers."""
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
