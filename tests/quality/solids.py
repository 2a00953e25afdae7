"""Tapered capsules (convex hulls of two balls) and distances to them."""

import functools
import math

import numpy as np
from numba import njit


class Capsules:
    """Tapered capsules, stored as arrays."""

    def __init__(self, starts, ends, start_radii, end_radii):
        self.starts, self.ends = np.asarray(starts, float), np.asarray(ends, float)
        self.start_radii, self.end_radii = np.asarray(start_radii, float), np.asarray(end_radii, float)
        axes = self.ends - self.starts
        self.lengths = np.maximum(np.linalg.norm(axes, axis=1), 1e-9)
        self.directions = axes / self.lengths[:, None]

    def __len__(self):
        return len(self.starts)

    def subset(self, indices):
        """The capsules at these indices."""
        return Capsules(
            self.starts[indices], self.ends[indices], self.start_radii[indices], self.end_radii[indices]
        )

    def at(self, fractions):
        """Centre and radius of the ball at a fraction of the way along each axis."""
        fractions = np.asarray(fractions)
        centres = self.starts + fractions[..., None] * (self.ends - self.starts)
        return centres, self.start_radii + fractions * (self.end_radii - self.start_radii)

    def distances(self, points):
        """Signed distance from each point (row) to each capsule's skin (column), negative inside.

        The hull is the union of the balls along the axis, so the distance is the minimum of |p - c(u)| - r(u). The
        radius falls by k per unit of length, and the derivative is zero where s - u = k rho / sqrt(1 - k^2).
        """
        offsets = np.asarray(points, float).reshape(-1, 1, 3) - self.starts
        along = np.einsum("pci,ci->pc", offsets, self.directions)
        across = np.sqrt(np.maximum(np.einsum("pci,pci->pc", offsets, offsets) - along**2, 0.0))
        slope = (self.start_radii - self.end_radii) / self.lengths
        # Where one ball contains the other, the larger one is the hull.
        tilt = np.where(np.abs(slope) < 1, slope / np.sqrt(np.maximum(1 - slope**2, 1e-12)), 0.0)
        at = np.where(slope >= 1, 0.0, np.where(slope <= -1, self.lengths, along - tilt * across))
        at = np.clip(at, 0.0, self.lengths)
        return np.hypot(along - at, across) - (self.start_radii - slope * at)

    def skin(self, spacing):
        """Points on the skins, about `spacing` apart, and the index of each one's capsule."""
        points, owners = [], []
        for i in range(len(self)):
            r, q, length = self.start_radii[i], self.end_radii[i], self.lengths[i]
            d = self.directions[i]
            side = np.cross(d, np.eye(3)[np.argmin(np.abs(d))])
            side /= np.linalg.norm(side)
            # The outline is an arc at each end and the line tangent to both balls.
            sine = np.clip((r - q) / length, -1.0, 1.0)
            tangent = np.arccos(sine)
            arcs = [np.linspace(np.pi, tangent, max(2, int(np.ceil((np.pi - tangent) * r / spacing)) + 1))]
            arcs.append(np.linspace(tangent, 0, max(2, int(np.ceil(tangent * q / spacing)) + 1)))
            outline = [np.stack([r * np.cos(arcs[0]), r * np.sin(arcs[0])], 1)]
            outline.append(np.stack([length + q * np.cos(arcs[1]), q * np.sin(arcs[1])], 1))
            steps = np.linspace(0, 1, max(2, int(np.ceil(length / spacing)) + 1))[1:-1, None]
            outline.append((1 - steps) * outline[0][-1] + steps * outline[1][0])
            for x, y in np.concatenate(outline):
                around = np.linspace(0, 2 * np.pi, max(1, int(np.ceil(2 * np.pi * y / spacing))), endpoint=False)
                ring = np.cos(around)[:, None] * side + np.sin(around)[:, None] * np.cross(d, side)
                points.append(self.starts[i] + x * d + y * ring)
                owners.append(np.full(len(ring), i))
        return np.concatenate(points), np.concatenate(owners)


def clearance(a, b):
    """Signed distance between the skins of each capsule of `a` (row) and each of `b` (column).

    Along an axis of `a`, the distance to `b` minus the radius of `a` is convex, so a ternary search finds the minimum;
    60 steps leave 1e-10 of the length.
    """
    rows, columns = np.divmod(np.arange(len(a) * len(b)), len(b))
    first, second = a.subset(rows), b.subset(columns)

    def value(fractions):
        centres, radii = first.at(fractions)
        offsets = centres - second.starts
        along = np.einsum("ci,ci->c", offsets, second.directions)
        across = np.sqrt(np.maximum(np.einsum("ci,ci->c", offsets, offsets) - along**2, 0.0))
        slope = (second.start_radii - second.end_radii) / second.lengths
        tilt = np.where(np.abs(slope) < 1, slope / np.sqrt(np.maximum(1 - slope**2, 1e-12)), 0.0)
        at = np.where(slope >= 1, 0.0, np.where(slope <= -1, second.lengths, along - tilt * across))
        at = np.clip(at, 0.0, second.lengths)
        return np.hypot(along - at, across) - (second.start_radii - slope * at) - radii

    low, high = np.zeros(len(rows)), np.ones(len(rows))
    for _ in range(60):
        third = (high - low) / 3
        left, right = low + third, high - third
        falls = value(left) > value(right)
        low, high = np.where(falls, left, low), np.where(falls, high, right)
    return value((low + high) / 2).reshape(len(a), len(b))


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
        """The ends of the edges with unequal numbers of triangles in either direction, and the difference."""
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

        Its area is no more than a fifth above the plane area that its rim can enclose (isoperimetric inequality).
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
