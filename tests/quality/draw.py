"""Small pictures of hand and object, without the giver, from the side that shows the touching digits best.

Draws sample points of skin and surface into a depth buffer: the judge's own geometry, not the client's meshes.
"""

import numpy as np
from scipy.spatial.transform import Rotation

import measures

# Pixels along each side, of the picture and of the trials that choose the view.
SIZE, TRIAL = 400, 100
# The kinds of pixels.
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
