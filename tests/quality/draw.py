"""Small pictures of hand and object, without the giver, from the side that shows the touching digits best.

Draws sample points of skin and surface into a depth buffer: the judge's own geometry, not the client's meshes.
"""

from dataclasses import dataclass

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

import measures
import stance
from hand import FOREARM_RADIUS, WRIST
from solids import Capsules

# Pixels along each side, of the picture and of the trials that choose the view.
SIZE, TRIAL = 400, 100
# What a pixel can show.
NOTHING, OBJECT, PALM, IDLE, TOUCHING, CONTACT = range(6)
COLOURS = np.array([[1, 1, 1], [0.55, 0.6, 0.66], [0.87, 0.72, 0.6], [0.93, 0.81, 0.7], [0.95, 0.66, 0.5], [0.8, 0, 0]])
# Value of seeing a pixel of each: touching parts matter most, and contacts are mostly hidden.
WORTH = np.array([0.0, 0.2, 0.1, 0.3, 1.0, 6.0])
# Number of directions to look from.
VIEWS = 40
# Distance between points on the skin in metres, about a pixel of the picture.
SPACING = 0.0012


def picture(scene, grasp):
    """An image of shape (SIZE, SIZE, 3) with values from 0 to 1; gravity points down where the view allows."""
    hand, contacts = measures.in_object_frame(scene, grasp)
    points, normals, kinds = cloud(scene.mesh, hand, contacts)
    up = scene.rotation.inv().apply(scene.up)
    coarse = np.concatenate([np.arange(0, len(points), 4), np.flatnonzero(kinds == CONTACT)])
    best = max(
        directions(),
        key=lambda d: WORTH[shown(points[coarse], kinds[coarse], axes_of(d, up), TRIAL, cover=0)[0]].sum(),
    )
    axes = axes_of(best, up)
    seen, nearest = shown(points, kinds, axes, SIZE)
    light = Rotation.from_matrix(axes.T).apply([0.3, 0.5, 0.8])
    # Light both sides: surfaces may be wound either way round.
    shade = 0.45 + 0.55 * np.abs(normals[nearest] @ light) / np.linalg.norm(light)
    shade[(seen == NOTHING) | (seen == CONTACT)] = 1.0
    return COLOURS[seen] * shade[..., None]


def cloud(mesh, hand, contacts):
    """Points to draw, their normals and their kinds."""
    surface, owners = measures.surface_samples(mesh)
    capsules, tags = hand.solids()
    skin, rows = capsules.skin(SPACING)
    touching = {contact["digit"] for contact in contacts}
    kind = [
        PALM if digit < 0 else TOUCHING if measures.DIGITS[digit] in touching else IDLE for digit in tags[:, 0]
    ]
    axis = capsules.directions[rows]
    offset = skin - capsules.starts[rows]
    along = np.clip(np.einsum("pi,pi->p", offset, axis), 0.0, capsules.lengths[rows])
    outward = offset - along[:, None] * axis
    outward /= np.maximum(np.linalg.norm(outward, axis=1), 1e-9)[:, None]
    # A small ball at each contact.
    ball = directions() * 0.0025
    dots = [contact["position"] + ball for contact in contacts]
    return (
        np.concatenate([surface, skin, *dots]),
        np.concatenate([mesh.normals[owners], outward] + [ball / 0.0025] * len(dots)),
        np.concatenate([np.full(len(surface), OBJECT), np.array(kind)[rows], np.full(len(ball) * len(dots), CONTACT)]),
    )


def directions():
    """Unit vectors spread evenly over the sphere, on a spiral."""
    i = np.arange(VIEWS) + 0.5
    height, around = 1 - 2 * i / VIEWS, np.pi * (1 + 5**0.5) * i
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(around), height, across * np.sin(around)], axis=1)


def axes_of(toward, up):
    """The view's axes as rows: right, up, and toward the eye."""
    if abs(toward @ up) > 0.95:
        up = np.eye(3)[np.argmin(np.abs(toward))]
    right = np.cross(up, toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])


def shown(points, kinds, axes, size, cover=1):
    """Kind and index of the nearest point at each pixel; a point covers its own pixel and `cover` more on each side."""
    flat = points @ axes.T
    centre, reach = (flat.max(axis=0) + flat.min(axis=0)) / 2, np.ptp(flat[:, :2], axis=0).max() / 2 * 1.04
    pixel = ((flat[:, :2] - centre[:2]) / reach * 0.5 + 0.5) * size
    order = np.argsort(flat[:, 2])
    nearest = np.full((size, size), -1)
    depth = np.full((size, size), -np.inf)
    for dx in range(-cover, cover + 1):
        for dy in range(-cover, cover + 1):
            x = np.clip(pixel[order, 0].astype(int) + dx, 0, size - 1)
            y = np.clip(size - 1 - pixel[order, 1].astype(int) + dy, 0, size - 1)
            # Of several points at one pixel, the last one written is the nearest to the eye.
            layer = np.full((size, size), -1)
            layer[y, x] = order
            distance = np.where(layer >= 0, flat[layer, 2], -np.inf)
            nearer = distance > depth
            nearest[nearer], depth[nearer] = layer[nearer], distance[nearer]
    return np.where(nearest >= 0, kinds[nearest], NOTHING), nearest


matplotlib.use("Agg")


LEGEND = (
    "Blue: the giver. Green: the receiver, if a plausible one has this hand; the wrist is bent as needed. Red: the"
    " forearm goes straight back from the hand, and no plausible receiver has it."
)
# Pixels along each side of a view.
SIZE = 440
# Distances between the points of a body and of what is small, in metres; a point covers three pixels of 2 to 4 mm.
BODY_SPACING, HAND_SPACING = 0.0045, 0.003
# What a pixel can show.
NOTHING, OBJECT, GIVER, GIVER_ARM, FITTING, FITTING_ARM, WRONG, WRONG_ARM = range(8)
BODIES = (GIVER, FITTING, WRONG)
COLOURS = np.array(
    [
        [1.0, 1.0, 1.0],
        [0.95, 0.7, 0.1],
        [0.72, 0.78, 0.88],
        [0.2, 0.4, 0.8],
        [0.74, 0.86, 0.74],
        [0.1, 0.6, 0.2],
        [0.9, 0.76, 0.74],
        [0.85, 0.15, 0.1],
    ]
)
# How far the bodies are moved away from the eye, in metres, so that they never hide arms and object.
BACKGROUND = 10.0
# Radii of torso, neck, head and upper arm, and heights of hips, neck and head over the shoulders, in metres.
TORSO, NECK, HEAD, ARM = 0.11, 0.05, 0.1, 0.045
HIPS, CROWN = -0.5, 0.23


@dataclass
class Person:
    """Someone to draw: a hand with its elbow and shoulder, and the direction in which the other shoulder is."""

    hand: object
    elbow: np.ndarray
    shoulder: np.ndarray
    outward: np.ndarray


def owner_of(hand, up):
    """The likeliest owner of a hand whose forearm goes straight back."""
    bodies = stance.behind(hand, up)
    elbow = hand.positions[WRIST] + stance.FOREARM * stance.forearm_direction(hand)
    return Person(hand, elbow, bodies.shoulders[0], bodies.outward[0])


def people(scene, grasp):
    """The giver, or None, the receiver, and whether the receiver's arm fits (None without a giver)."""
    hand = measures.hand_of_reply(grasp)
    receiver = owner_of(hand, scene.up)
    if scene.giver is None:
        return None, receiver, None
    found = stance.nearest(hand, stance.receivers(scene.giver, scene.up, hand.handedness), scene.up)
    fits = found.angle <= stance.NEAR_RECEIVER and found.reachable
    receiver.shoulder, receiver.outward = found.bodies.shoulders[found.owner], found.bodies.outward[found.owner]
    if fits:
        receiver.elbow = found.elbow
    return owner_of(scene.giver, scene.up), receiver, fits


def capsules_of(person, up):
    """The capsules of torso, shoulders, neck and head, then those of upper arm and forearm."""
    other = person.shoulder - 2 * stance.HALF_SHOULDERS * person.outward
    middle = (person.shoulder + other) / 2
    sides = [middle + sign * (stance.HALF_SHOULDERS - TORSO) * person.outward for sign in (1, -1)]
    body = [(side - TORSO * up, side + HIPS * up, TORSO, TORSO) for side in sides]
    body += [(person.shoulder, other, ARM, ARM), (middle, middle + CROWN * up, NECK, NECK)]
    body += [(middle + (CROWN - 0.02) * up, middle + (CROWN + 0.02) * up, HEAD, HEAD)]
    wrist = person.hand.positions[WRIST]
    arm = [(person.shoulder, person.elbow, ARM, ARM), (person.elbow, wrist, FOREARM_RADIUS, person.hand.radii[WRIST])]
    return Capsules(*zip(*body)), Capsules(*zip(*arm))


def skin(capsules, spacing):
    """Points on capsules, and the outward normals there."""
    points, rows = capsules.skin(spacing)
    axis, offset = capsules.directions[rows], points - capsules.starts[rows]
    along = np.clip(np.einsum("pi,pi->p", offset, axis), 0.0, capsules.lengths[rows])
    return points, stance.unit(offset - along[:, None] * axis)


def cloud(scene, grasp):
    """Points to draw in the client's frame, their normals and their kinds."""
    giver, receiver, fits = people(scene, grasp)
    surface, owners = measures.surface_samples(scene.mesh)
    turn = scene.rotation
    parts = [(turn.apply(surface) + scene.translation, turn.apply(scene.mesh.normals[owners]), OBJECT)]
    kinds = (WRONG, WRONG_ARM) if fits is False else (FITTING, FITTING_ARM)
    for person, (plain, strong) in [(giver, (GIVER, GIVER_ARM)), (receiver, kinds)]:
        if person is not None:
            body, arm = capsules_of(person, scene.up)
            parts.append((*skin(body, BODY_SPACING), plain))
            parts.append((*skin(arm, BODY_SPACING), strong))
            parts.append((*skin(person.hand.solids()[0], HAND_SPACING), strong))
    return (
        np.concatenate([points for points, _, _ in parts]),
        np.concatenate([normals for _, normals, _ in parts]),
        np.concatenate([np.full(len(points), kind) for points, _, kind in parts]),
    )


def picture(scene, grasp):
    """An image of shape (SIZE, 2 SIZE, 3), from the side and from above; the giver is on the left."""
    points, normals, kinds = cloud(scene, grasp)
    if scene.giver is None:
        # The receiver is on the right here, too.
        across = -stance.behind(measures.hand_of_reply(grasp), scene.up).forward[0]
    else:
        across = stance.behind(scene.giver, scene.up).forward[0]
    beside = np.cross(across, scene.up)
    views = []
    for axes in (np.stack([across, scene.up, beside]), np.stack([across, -beside, scene.up])):
        backed = points - BACKGROUND * np.isin(kinds, BODIES)[:, None] * axes[2]
        seen, nearest = shown(backed, kinds, axes, SIZE)
        light = axes.T @ [0.3, 0.5, 0.8]
        shade = 0.5 + 0.5 * np.abs(normals[nearest] @ light) / np.linalg.norm(light)
        shade[seen == NOTHING] = 1.0
        view = COLOURS[seen] * shade[..., None]
        view[:, -1] = 0.8
        views.append(view)
    return np.concatenate(views, axis=1)


def file_of(drawing):
    """Where the picture beside a drawing of the hand alone is."""
    return drawing.with_name(drawing.name.replace("-alone", "-stance"))


def caption(row):
    """The measures of a grasp in a few words, and a colour."""
    if "stance_fits" not in row:
        return f"nobody holding; from {row['from_held']}", "#404040"
    reach = "elbow reachable" if row["elbow_reachable"] else "elbow NOT reachable"
    angles = f"off receiver's {row['receiver_angle']:.0f}°, off giver's {row['giver_angle']:.0f}°"
    good = row["stance_fits"] and row["giver_angle"] >= stance.NEAR_GIVER
    return f"{angles}, {reach}", "#207020" if good else "#b02020"


def sheet(folder, found, across=2):
    """Puts all pictures of a run on one sheet, stance.png; false if there are none."""
    drawn = []
    for row in found:
        file = folder / "pictures" / (row.get("picture") or "").replace(".png", "-stance.png")
        if row.get("picture") and file.exists():
            drawn.append((row, file))
    if not drawn:
        return False
    down = -(-len(drawn) // across)
    figure, axes = plt.subplots(down, across, figsize=(8.0 * across, 4.3 * down), layout="constrained", squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for axis, (row, file) in zip(axes.flat, drawn):
        axis.imshow(plt.imread(file)[..., :3])
        text, colour = caption(row)
        axis.set_title(f"{row['object']} {row['holdout']}: {text}", fontsize=9, color=colour)
        for x, name in [(8, "from the side"), (SIZE + 8, "from above")]:
            axis.text(x, SIZE - 8, name, fontsize=8, color="#606060")
    figure.savefig(folder / "stance.png", dpi=90)
    plt.close(figure)
    return True
