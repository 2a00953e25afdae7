"""The object as convex pieces for the physics engine, and its mass properties.

CoACD makes the pieces (Wei et al. 2022, "Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity
and Tree Search"). They are cached in target/quality/convex by a hash of the mesh and the settings.
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
# How far a piece may span a hollow by CoACD's measure: a share of the thinnest side of the object's box, and its bounds
# in metres. Pieces bulge less than that (at 1.2 to 2 mm, by 0.5 to 0.9 mm at the 99th percentile); half takes ten times
# as long.
CONCAVITY, FINEST, COARSEST = 0.07, 0.001, 0.002
# Cells along the longest side when CoACD has to make a mesh watertight; detail finer than a cell is lost.
RESOLUTION = 100
# Nodes and rounds of the tree search; CoACD's defaults, 20 and 150, take several times as long for pieces no better.
NODES, ROUNDS = 10, 20


def pieces(mesh):
    """The corners of each convex piece, an (n, 3) array in metres in the mesh's frame."""
    concavity = float(np.clip(CONCAVITY * (mesh.high - mesh.low).min(), FINEST, COARSEST))
    key = hashlib.sha256(repr((concavity, RESOLUTION, NODES, ROUNDS)).encode())
    key.update(np.ascontiguousarray(mesh.vertices, np.float64).tobytes())
    key.update(np.ascontiguousarray(mesh.faces, np.int64).tobytes())
    file = FOLDER / f"{key.hexdigest()[:32]}.npz"
    if not file.exists():
        parts = [part for shell in shells(mesh) for part in decomposed(*shell, concavity)]
        FOLDER.mkdir(parents=True, exist_ok=True)
        # Written under another name and renamed, because other processes may be reading the folder.
        with tempfile.NamedTemporaryFile(dir=FOLDER, suffix=".npz", delete=False) as unfinished:
            np.savez_compressed(unfinished, *parts)
        os.replace(unfinished.name, file)
    with np.load(file) as stored:
        return [stored[name] for name in stored.files]


def shells(mesh):
    """Vertices and faces of each connected part of the surface. Parts may overlap; each is simpler than the whole."""
    points, merged = np.unique(np.round(mesh.vertices, 7), axis=0, return_inverse=True)
    faces = merged.ravel()[mesh.faces]
    links = coo_array((np.ones(2 * len(faces)), (faces[:, :2].ravel(), faces[:, 1:].ravel())), 2 * [len(points)])
    _, labels = connected_components(links, directed=False)
    for label in np.unique(labels[faces[:, 0]]):
        own = faces[labels[faces[:, 0]] == label]
        used, renumbered = np.unique(own, return_inverse=True)
        yield points[used], renumbered.reshape(-1, 3)


def decomposed(vertices, faces, concavity):
    """The convex pieces of one shell: the shell itself if it spans no hollow, else CoACD's pieces."""
    try:
        planes = ConvexHull(vertices).equations
    except QhullError:
        # A flat shell encloses no volume.
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
    """The inertia tensor, in square metres, of one kilogram spread evenly over the pieces, about their common centre.

    Sums tetrahedra between a piece's faces and its middle. Over a tetrahedron with corners a, b, c, d, the integral of
    x x^T is volume / 20 (sum of the corners' x x^T + the outer product of the corners' sum).
    """
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for corners in parts:
        hull = ConvexHull(corners)
        middle = corners.mean(axis=0)
        for a, b, c in corners[hull.simplices]:
            size = abs(np.linalg.det([a - middle, b - middle, c - middle])) / 6
            tetrahedron = np.array([a, b, c, middle])
            total = tetrahedron.sum(axis=0)
            volume += size
            first += size * total / 4
            second += size / 20 * (tetrahedron.T @ tetrahedron + np.outer(total, total))
    centre = first / volume
    second = second / volume - np.outer(centre, centre)
    return np.trace(second) * np.eye(3) - second
