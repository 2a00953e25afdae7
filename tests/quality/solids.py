"""Tapered capsules (convex hulls of two balls) and distances to them."""

import numpy as np


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
