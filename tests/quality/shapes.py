"""Shapes for the judge's own tests."""

import numpy as np

BOX_FACES = [
    [0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4],
    [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7],
]  # fmt: skip


def box(half, centre=(0, 0, 0), axes=None):
    """Vertices of a box of these half extents along the rows of `axes`."""
    x, y, z = half
    corners = np.array([[i * x, j * y, k * z] for k in (-1, 1) for i, j in [(-1, -1), (1, -1), (1, 1), (-1, 1)]])
    return corners @ (np.eye(3) if axes is None else axes) + centre
