"""Pictures of who stands where: giver and receiver as mannequins, from the side and from above, with object and hands.

The giver is blue. The receiver stands where a plausible one is whose forearm is nearest to that of the hand, and is
green if the arm fits and red if it does not: then the forearm goes straight back from the hand, wherever that leads.
"""

from dataclasses import dataclass

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import draw
import measures
import stance
from hand import FOREARM_RADIUS, WRIST
from solids import Capsules

LEGEND = (
    "Blue: the giver. Green: the receiver, if a plausible one has this hand; the wrist is bent as needed. Red: the"
    " forearm goes straight back from the hand, and no plausible receiver has it."
)
# Pixels along each side of a view.
SIZE = 440
# Distances between the points of a body and of small things, in metres; a point covers three pixels of 2 to 4 mm.
BODY_SPACING, HAND_SPACING = 0.0045, 0.003
# The kinds of pixels.
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
        seen, nearest = draw.shown(backed, kinds, axes, SIZE)
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
