"""Checks every row of client/importers.json with a file that has no mirror symmetry: contacts in the row's convention lie on the mesh
as the importer places it, turned as the row says."""

import json
import math

import grpc
import pytest

from conftest import ROOT

from grasp.v1 import grasp_service_pb2, grasp_service_pb2_grpc, holdout_pb2, object_service_pb2, object_service_pb2_grpc, search_pb2

IMPORTERS = json.loads((ROOT / "client/importers.json").read_text())
NAME = "objects/importers-chiral"
TOLERANCE = 1e-4
# A bar along y, with arms of other lengths along x and z: halves of edges and centers, in meters.
BOXES = [((0.012, 0.07, 0.012), (0, 0, 0)), ((0.03, 0.01, 0.01), (0.035, 0.06, 0)), ((0.01, 0.01, 0.02), (0, -0.06, 0.025))]
FACES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def mesh():
    """The corners of each triangle."""
    for half, center in BOXES:
        corner = [tuple(center[k] + half[k] * (2 * (i >> k & 1) - 1) for k in range(3)) for i in range(8)]
        for w, x, y, z in FACES:
            yield corner[w], corner[x], corner[y]
            yield corner[w], corner[y], corner[z]


def minus(a, b):
    return tuple(x - y for x, y in zip(a, b))


def plus(a, b, factor=1):
    return tuple(x + factor * y for x, y in zip(a, b))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def turned(point, quaternion):
    *axis, w = quaternion
    return plus(point, cross(axis, plus(cross(axis, point), point, w)), 2)


def imported(row, vertex):
    """The vertex in the object's frame of the row's convention, which is that of the mesh as the importer places it, turned."""
    placed = tuple((-1 if axis[0] == "-" else 1) * row["scale"] * vertex["xyz".index(axis[-1])] for axis in row["axes"])
    return turned(placed, row.get("turn", (0, 0, 0, 1)))


def distance(point, corners):
    """From a point to a triangle."""
    a, b, c = corners
    edges = ((a, b), (b, c), (c, a))
    normal = cross(minus(b, a), minus(c, a))
    height = dot(minus(point, a), normal) / dot(normal, normal)
    foot = plus(point, normal, -height)
    if all(dot(cross(minus(q, p), minus(foot, p)), normal) >= 0 for p, q in edges):
        return abs(height) * math.sqrt(dot(normal, normal))
    nearest = []
    for p, q in edges:
        edge = minus(q, p)
        along = min(1, max(0, dot(minus(point, p), edge) / dot(edge, edge)))
        nearest.append(math.dist(point, plus(p, edge, along)))
    return min(nearest)


def farthest(row, contacts):
    """The largest distance of contacts to the mesh, in meters."""
    triangles = [[imported(row, vertex) for vertex in triangle] for triangle in mesh()]
    return max(min(distance(contact, one) for one in triangles) for contact in contacts) / row["scale"]


@pytest.fixture(scope="module")
def contacts(channel):
    """The contacts of grasps from several sides, by convention, in the object's frame."""
    obj = "".join("".join(f"v {x} {y} {z}\n" for x, y, z in triangle) + "f -3 -2 -1\n" for triangle in mesh())
    objects = object_service_pb2_grpc.ObjectServiceStub(channel)
    grasps = grasp_service_pb2_grpc.GraspServiceStub(channel)
    created = object_service_pb2.GraspObject(name=NAME, mass_kg=0.2, meters_per_unit=1)
    objects.CreateObject(object_service_pb2.CreateObjectRequest(object=created, mesh=obj.encode()))
    found = {}
    for convention in {row["convention"] for row in IMPORTERS}:
        points = []
        for seed in range(1, 5):
            request = grasp_service_pb2.FindGraspRequest(
                holdout=holdout_pb2.Holdout(object=NAME),
                search=search_pb2.SearchOptions(seed=seed, choice="GRASP_CHOICE_REPRODUCIBLE", ignore_atlas=True),
                output=search_pb2.OutputOptions(convention=convention),
            )
            request.search.budget.FromSeconds(5)
            for contact in grasps.FindGrasp(request).grasps[0].contacts:
                points.append((contact.position.x, contact.position.y, contact.position.z))
        found[convention] = points
    yield found
    objects.DeleteObject(object_service_pb2.DeleteObjectRequest(name=NAME))


@pytest.mark.parametrize("row", IMPORTERS, ids=lambda row: f"{row['engine']}: {row['importer']}")
def test_contacts_lie_on_the_imported_mesh(row, contacts):
    assert farthest(row, contacts[row["convention"]]) < TOLERANCE


def test_contacts_do_not_lie_on_a_mesh_with_other_axes(contacts):
    for row in IMPORTERS:
        for other in IMPORTERS:
            same = math.dist(imported(row, (1, 2, 3)), imported(other, (1, 2, 3))) < 1e-3
            if row["scale"] == other["scale"] and not same:
                assert farthest(other, contacts[row["convention"]]) > 100 * TOLERANCE, (row, other)


def test_turns_are_rotations():
    assert all(math.isclose(math.hypot(*row["turn"]), 1, abs_tol=1e-6) for row in IMPORTERS if "turn" in row)
