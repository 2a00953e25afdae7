"""The object as convex pieces for the physics engine, and its mass properties.

Pieces come from CoACD (Wei et al. 2022, "Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity
and Tree Search"), and are kept in target/quality/convex by the hash of the mesh and of the settings.
"""

import hashlib
import os
import pathlib
import tempfile

import coacd
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDER = ROOT / "target/quality/convex"
# How far a piece may span a hollow by CoACD's measure, as a share of the thinnest side of the object's box, and least and
# most in metres. What pieces add to the surface is less: at 1.2 to 2 mm, 0.5 to 0.9 mm at 99 of 100 places of a banana, a
# hammer, a mug and a wine glass. Half of it takes up to ten times as long to decompose.
CONCAVITY, FINEST, COARSEST = 0.07, 0.001, 0.002
# Cells along the longest side when CoACD has to make a mesh watertight; it loses detail finer than a cell.
RESOLUTION = 100
# The tree search's nodes and rounds: CoACD's own 20 and 150 take several times as long for pieces as good.
NODES, ROUNDS = 10, 20


def pieces(mesh):
    """The corners of each convex piece, each (n, 3), in the mesh's frame in metres."""
    concavity = float(np.clip(CONCAVITY * (mesh.high - mesh.low).min(), FINEST, COARSEST))
    key = hashlib.sha256(repr((concavity, RESOLUTION, NODES, ROUNDS)).encode())
    key.update(np.ascontiguousarray(mesh.vertices, np.float64).tobytes())
    key.update(np.ascontiguousarray(mesh.faces, np.int64).tobytes())
    file = FOLDER / f"{key.hexdigest()[:32]}.npz"
    if not file.exists():
        parts = [part for shell in shells(mesh) for part in decomposed(*shell, concavity)]
        FOLDER.mkdir(parents=True, exist_ok=True)
        # Whole or not at all: others may read the folder at the same time.
        with tempfile.NamedTemporaryFile(dir=FOLDER, suffix=".npz", delete=False) as unfinished:
            np.savez_compressed(unfinished, *parts)
        os.replace(unfinished.name, file)
    with np.load(file) as stored:
        return [stored[name] for name in stored.files]


def shells(mesh):
    """Vertices and faces of each connected part of the surface: parts of a thing may overlap, and each is simpler."""
    places, merged = np.unique(np.round(mesh.vertices, 7), axis=0, return_inverse=True)
    faces = merged.ravel()[mesh.faces]
    links = coo_array((np.ones(2 * len(faces)), (faces[:, :2].ravel(), faces[:, 1:].ravel())), 2 * [len(places)])
    _, labels = connected_components(links, directed=False)
    for label in np.unique(labels[faces[:, 0]]):
        own = faces[labels[faces[:, 0]] == label]
        used, renumbered = np.unique(own, return_inverse=True)
        yield places[used], renumbered.reshape(-1, 3)


def decomposed(vertices, faces, concavity):
    """The convex pieces of one shell: itself when it spans no hollow, else what CoACD makes of it."""
    try:
        planes = ConvexHull(vertices).equations
    except QhullError:
        # Flat: it holds nothing, and nothing can press on it from within.
        return []
    middles = np.concatenate([vertices, vertices[faces].mean(axis=1)])
    if (middles @ planes[:, :3].T + planes[:, 3]).max(axis=1).min() > -concavity:
        return [vertices]
    coacd.set_log_level("error")
    parts = coacd.run_coacd(
        coacd.Mesh(vertices, faces),
        threshold=concavity,
        real_metric=True,
        preprocess_resolution=RESOLUTION,
        mcts_nodes=NODES,
        mcts_iterations=ROUNDS,
        seed=1,
    )
    return [corners for corners, _ in parts]


def unit_inertia(parts):
    """The inertia tensor of one kilogram spread evenly over the pieces, about their common centre, in square metres.

    Tetrahedra between a piece's faces and its middle: for corners a, b, c, d about their origin, the integral of
    x x^T is volume / 20 (sum of the corners' x x^T + the outer product of the corners' sum).
    """
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for corners in parts:
        hull = ConvexHull(corners)
        middle = corners.mean(axis=0)
        for a, b, c in corners[hull.simplices]:
            size = abs(np.linalg.det([a - middle, b - middle, c - middle])) / 6
            of_all = np.array([a, b, c, middle])
            total = of_all.sum(axis=0)
            volume += size
            first += size * total / 4
            second += size / 20 * (of_all.T @ of_all + np.outer(total, total))
    centre = first / volume
    second = second / volume - np.outer(centre, centre)
    return np.trace(second) * np.eye(3) - second
