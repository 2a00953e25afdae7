"""The object's surface: its OBJ file, and signed distances to it.

The generalised winding number (Jacobson, Kavan and Sorkine-Hornung 2013) decides what is inside: the sum of the signed
solid angles that the triangles subtend at a point (van Oosterom and Strackee 1983), divided by 4 pi. It gives sensible
answers for open surfaces and overlapping parts as well.
"""

import functools
import math

import numpy as np
from numba import njit

# Distance between neighbouring sample points of a surface in metres. No point is farther than half of it from a sample,
# so a depth in flesh of radius 7 mm is underestimated by at most 0.75^2 / 14 mm = 0.04 mm.
SPACING = 0.0015
# Size of a grid cell in metres of which one sample is kept; fine and slender triangles yield too many.
CELL = 0.0005


def thinned(points, cell):
    """Indices of one point per occupied cell of a grid."""
    return np.unique(np.floor(points / cell).astype(np.int64), axis=0, return_index=True)[1]


@njit(cache=True)
def _winding(points, triangles):
    result = np.empty(len(points))
    for i in range(len(points)):
        px, py, pz = points[i]
        total = 0.0
        for t in range(len(triangles)):
            ax, ay, az = triangles[t, 0, 0] - px, triangles[t, 0, 1] - py, triangles[t, 0, 2] - pz
            bx, by, bz = triangles[t, 1, 0] - px, triangles[t, 1, 1] - py, triangles[t, 1, 2] - pz
            cx, cy, cz = triangles[t, 2, 0] - px, triangles[t, 2, 1] - py, triangles[t, 2, 2] - pz
            a = math.sqrt(ax * ax + ay * ay + az * az)
            b = math.sqrt(bx * bx + by * by + bz * bz)
            c = math.sqrt(cx * cx + cy * cy + cz * cz)
            volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
            total += math.atan2(volume, a * b * c + ab * c + bc * a + ca * b)
        result[i] = total / (2.0 * math.pi)
    return result


@njit(cache=True)
def _closest_on_triangle(p, a, b, c):
    """The closest point, by the regions of Ericson, "Real-Time Collision Detection", 5.1.5."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = np.dot(ab, ap), np.dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    bp = p - b
    d3, d4 = np.dot(ab, bp), np.dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return b
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return a + (d1 / max(d1 - d3, 1e-300)) * ab
    cp = p - c
    d5, d6 = np.dot(ab, cp), np.dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return c
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return a + (d2 / max(d2 - d6, 1e-300)) * ac
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return b + ((d4 - d3) / max((d4 - d3) + (d5 - d6), 1e-300)) * (c - b)
    total = max(va + vb + vc, 1e-300)
    return a + (vb / total) * ab + (vc / total) * ac


@njit(cache=True)
def _closest(points, triangles, centres, radii):
    distances = np.empty(len(points))
    nearest = np.empty(len(points), np.int64)
    for i in range(len(points)):
        p = points[i]
        best, index = np.inf, -1
        for t in range(len(triangles)):
            dx, dy, dz = p[0] - centres[t, 0], p[1] - centres[t, 1], p[2] - centres[t, 2]
            reach = best + radii[t]
            if dx * dx + dy * dy + dz * dz >= reach * reach:
                continue
            offset = p - _closest_on_triangle(p, triangles[t, 0], triangles[t, 1], triangles[t, 2])
            distance = math.sqrt(np.dot(offset, offset))
            if distance < best:
                best, index = distance, t
        distances[i], nearest[i] = best, index
    return distances, nearest


class Mesh:
    """Triangles in metres, with the groups named in the OBJ file."""

    def __init__(self, vertices, faces, groups=None):
        self.vertices = np.asarray(vertices, float)
        self.faces = np.asarray(faces, np.int64).reshape(-1, 3)
        self.groups = np.asarray([""] * len(self.faces) if groups is None else groups)
        self.triangles = np.ascontiguousarray(self.vertices[self.faces])
        crosses = np.cross(
            self.triangles[:, 1] - self.triangles[:, 0], self.triangles[:, 2] - self.triangles[:, 0]
        )
        lengths = np.linalg.norm(crosses, axis=1)
        self.areas = lengths / 2
        self.normals = crosses / np.maximum(lengths, 1e-300)[:, None]
        self.centres = self.triangles.mean(axis=1)
        self.radii = np.linalg.norm(self.triangles - self.centres[:, None], axis=2).max(axis=1)
        used = self.vertices[np.unique(self.faces)]
        self.low, self.high = used.min(axis=0), used.max(axis=0)

    @classmethod
    def read_obj(cls, path, unit_metres=1.0):
        """Reads the vertices and polygons of an OBJ file; polygons become triangle fans."""
        vertices, faces, groups, group = [], [], [], ""
        for line in open(path, encoding="utf-8", errors="replace"):
            words = line.split()
            if not words:
                continue
            if words[0] == "v":
                vertices.append([float(word) * unit_metres for word in words[1:4]])
            elif words[0] in ("g", "o", "usemtl"):
                group = " ".join(words[1:])
            elif words[0] == "f":
                corners = [int(word.split("/")[0]) for word in words[1:]]
                corners = [corner - 1 if corner > 0 else len(vertices) + corner for corner in corners]
                for i in range(1, len(corners) - 1):
                    faces.append([corners[0], corners[i], corners[i + 1]])
                    groups.append(group)
        return cls(vertices, faces, groups)

    @functools.cached_property
    def rims(self):
        """The ends of the edges along which not as many triangles run one way as the other, and how many more."""
        places, merged = np.unique(np.round(self.vertices, 7), axis=0, return_inverse=True)
        corners = merged.ravel()[self.faces]
        edges = np.concatenate([corners[:, [i, (i + 1) % 3]] for i in range(3)])
        turns = np.where(edges[:, 0] < edges[:, 1], 1, -1)
        edges, of_edge = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
        excess = np.abs(np.bincount(of_edge.ravel(), weights=turns))
        return places[edges[excess > 0]], excess[excess > 0]

    def closed(self):
        """Whether the surface encloses a volume."""
        return len(self.rims[0]) == 0

    def is_sheet(self):
        """Whether the surface is open and so flat that it encloses nothing.

        Its area is no more than a fifth above what its rim encloses in a plane (isoperimetric inequality).
        """
        rims, excess = self.rims
        length = (np.linalg.norm(rims[:, 1] - rims[:, 0], axis=1) * excess).sum()
        return 0 < self.areas.sum() <= 1.2 * length**2 / (4 * math.pi)

    def winding(self, points):
        """How often the surface winds round each point: 1 inside a closed surface, 0 outside."""
        return _winding(np.ascontiguousarray(points, float).reshape(-1, 3), self.triangles)

    def closest(self, points):
        """The distance of each point to the surface, and the index of the nearest triangle."""
        return _closest(
            np.ascontiguousarray(points, float).reshape(-1, 3), self.triangles, self.centres, self.radii
        )

    def depth(self, points):
        """The largest depth of a point inside the volume in metres; 0 if none is inside, as in a sheet."""
        points = np.asarray(points, float).reshape(-1, 3)
        boxed = points[((points > self.low) & (points < self.high)).all(axis=1)]
        if len(boxed) == 0 or self.is_sheet():
            return 0.0
        inside = boxed[np.abs(self.winding(boxed)) > 0.5]
        return float(self.closest(inside)[0].max()) if len(inside) else 0.0

    def signed_distance(self, points):
        """The distance of each point to the surface, negative inside."""
        distance = self.closest(points)[0]
        return np.where(np.abs(self.winding(points)) > 0.5, -distance, distance)

    def samples(self, faces=None):
        """Points on the surface, about SPACING apart or less, and the triangle of each."""
        points, owners = [], []
        for face in range(len(self.faces)) if faces is None else faces:
            a, b, c = self.triangles[face]
            longest = max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b))
            n = max(1, math.ceil(longest / SPACING))
            if n == 1:
                chosen = self.triangles[face]
            else:
                i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
                keep = i + j <= n
                u, v = (i[keep] / n)[:, None], (j[keep] / n)[:, None]
                chosen = a + u * (b - a) + v * (c - a)
            points.append(chosen)
            owners.append(np.full(len(chosen), face))
        if not points:
            return np.empty((0, 3)), np.empty(0, np.int64)
        points, owners = np.concatenate(points), np.concatenate(owners)
        kept = thinned(points, CELL)
        return points[kept], owners[kept]
