"""Capsules, winding numbers and distances, against closed forms and brute force."""

import numpy as np
import pytest

from solids import Capsules, clearance, Mesh


def box_mesh(half):
    return Mesh(box(half), BOX_FACES)


class TestCapsules:
    def test_distance_to_an_untapered_capsule(self):
        capsule = Capsules([[0, 0, 0]], [[0, 0.1, 0]], [0.01], [0.01])
        points = [[0.03, 0.05, 0], [0, 0.13, 0], [0.03, 0.14, 0], [0.004, 0.05, 0], [0, -0.02, 0]]
        expected = [0.02, 0.02, 0.04, -0.006, 0.01]
        np.testing.assert_allclose(capsule.distances(points)[:, 0], expected, atol=1e-12)

    def test_distance_to_a_tapered_capsule_is_the_minimum_over_its_balls(self):
        random = np.random.default_rng(1)
        for _ in range(30):
            a, b = random.uniform(-0.05, 0.05, (2, 3))
            r, q = random.uniform(0.005, 0.02, 2)
            points = random.uniform(-0.1, 0.1, (50, 3))
            steps = np.linspace(0, 1, 20001)
            centres, radii = a + steps[:, None] * (b - a), r + steps * (q - r)
            brute = [(np.linalg.norm(centres - p, axis=1) - radii).min() for p in points]
            found = Capsules([a], [b], [r], [q]).distances(points)[:, 0]
            np.testing.assert_allclose(found, brute, atol=1e-8)

    def test_skin_samples_lie_on_the_skin(self):
        capsules = Capsules([[0, 0, 0], [0.1, 0, 0]], [[0, 0.05, 0.01], [0.1, 0, 0.03]], [0.01, 0.006], [0.006, 0.012])
        points, owners = capsules.skin(0.002)
        own = capsules.distances(points)[np.arange(len(points)), owners]
        assert np.abs(own).max() < 2e-4
        # Both poles are among them.
        for row, pole in [(0, capsules.at(np.zeros(2))), (1, capsules.at(np.ones(2)))]:
            assert np.linalg.norm(points - pole[0][row], axis=1).min() < pole[1][row] + 1e-9

    def test_clearance_of_parallel_crossing_and_aligned_capsules(self):
        first = Capsules([[0, 0, 0]], [[0, 0.1, 0]], [0.01], [0.01])
        others = Capsules(
            [[0.05, 0.02, 0], [-0.1, 0.05, 0.03], [0, 0.15, 0], [-0.1, 0.05, 0.005]],
            [[0.05, 0.2, 0], [0.1, 0.05, 0.03], [0, 0.2, 0], [0.1, 0.05, 0.005]],
            [0.005, 0.01, 0.01, 0.01],
            [0.005, 0.01, 0.01, 0.01],
        )
        np.testing.assert_allclose(clearance(first, others)[0], [0.035, 0.01, 0.03, -0.015], atol=1e-9)
        np.testing.assert_allclose(clearance(others, first)[:, 0], [0.035, 0.01, 0.03, -0.015], atol=1e-9)


class TestMesh:
    def test_winding_and_distance_of_a_closed_cube(self):
        mesh = box_mesh([0.5, 0.5, 0.5])
        winding = mesh.winding([[0, 0, 0], [0.4, -0.3, 0.2], [0.6, 0, 0], [3, 3, 3]])
        np.testing.assert_allclose(winding, [1, 1, 0, 0], atol=1e-12)
        np.testing.assert_allclose(
            mesh.signed_distance([[0, 0, 0.1], [0.4, 0, 0], [0.8, 0.9, 0]]), [-0.4, -0.1, 0.5], atol=1e-12
        )

    def test_open_and_inside_out_boxes_still_have_an_inside(self):
        # From the middle of a cube without its top, five of six equal solid angles are left.
        lid = [2, 3]
        faces = [face for i, face in enumerate(BOX_FACES) if i not in lid]
        mesh = Mesh(box([0.5, 0.5, 0.5]), faces)
        np.testing.assert_allclose(mesh.winding([[0, 0, 0]]), [5 / 6], atol=1e-12)
        assert mesh.signed_distance([[0, 0, 0]])[0] == pytest.approx(-0.5)
        assert mesh.signed_distance([[0, 0, 2]])[0] > 0
        turned = Mesh(box([0.5, 0.5, 0.5]), [face[::-1] for face in BOX_FACES])
        assert turned.signed_distance([[0, 0, 0.3]])[0] == pytest.approx(-0.2)

    def test_overlap_of_two_parts_is_inside(self):
        both = Mesh(
            np.concatenate([box([0.5] * 3), box([0.5] * 3, (0.4, 0, 0))]),
            BOX_FACES + [[i + 8 for i in face] for face in BOX_FACES],
        )
        np.testing.assert_allclose(both.winding([[0.2, 0, 0], [-0.3, 0, 0]]), [2, 1], atol=1e-12)

    def test_samples_leave_no_gap_wider_than_the_spacing(self):
        mesh = box_mesh([0.01, 0.02, 0.005])
        points, _ = mesh.samples()
        assert mesh.closest(points)[0].max() < 1e-12
        random = np.random.default_rng(2)
        corners = mesh.triangles[random.integers(12, size=200)]
        weights = random.dirichlet([1, 1, 1], 200)
        on_surface = np.einsum("nk,nki->ni", weights, corners)
        gaps = np.linalg.norm(on_surface[:, None] - points[None], axis=2).min(axis=1)
        assert gaps.max() < 0.0015

    def test_reads_polygons_negative_indices_and_groups_of_an_obj(self, tmp_path):
        file = tmp_path / "box.obj"
        file.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng one\nf 1/1/1 2/2/2 3//3 4\ng two\nf -4 -3 -2\n")
        mesh = Mesh.read_obj(file, 0.001)
        assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]
        assert mesh.groups.tolist() == ["one", "one", "two"]
        assert mesh.high.tolist() == [0.001, 0.001, 0.0]


BOX_FACES = [
    [0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4],
    [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7],
]  # fmt: skip


def box(half, centre=(0, 0, 0), axes=None):
    """Vertices of a box of these half extents along the rows of `axes`."""
    x, y, z = half
    corners = np.array([[i * x, j * y, k * z] for k in (-1, 1) for i, j in [(-1, -1), (1, -1), (1, 1), (-1, 1)]])
    return corners @ (np.eye(3) if axes is None else axes) + centre
