"""What a hand does with an object: which parts of it touch, from which side, and how the thumb opposes the fingers.

Everything comes from the joint poses with radii, the contacts of the reply and the object's surface, in the object's
frame. Lengths are in metres, angles in degrees. Memberships run from 0 to 1.
"""

from dataclasses import dataclass

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
# Distance between the samples of the surface that stand for it here.
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
                # What presses says more about the opposition than what merely touches.
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
