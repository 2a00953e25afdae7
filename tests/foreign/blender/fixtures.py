"""Scenes and checks of the tests in Blender, with an empty scene for each."""

import base64
import json
import math
import os
import pathlib
import re
import struct
import sys
import time
import types
import unittest.mock

import bpy
import pytest
import yaml
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "client/blender"))

import grasp_blender  # noqa: E402
from grasp_blender import axes, connect, glb, hands, kinematics, messages, motion, objects  # noqa: E402
from grasp_blender import recordings, scenes, session  # noqa: E402
from grasp_blender.axes import BLENDER  # noqa: E402

ADDRESS = os.environ["GRASP_ADDRESS"]
GOLDEN = json.loads((ROOT / "proto/golden/grasps.json").read_text())
LEFT, RIGHT = kinematics.HANDEDNESSES
# A shape without symmetry: three arms of different lengths along the axes, of its file.
CHIRAL = ((0.12, 0.02, 0.02), (0.02, 0.16, 0.02), (0.02, 0.02, 0.09))


@pytest.fixture(autouse=True)
def scene():
    """An empty file with the add-on and the server's address."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    grasp_blender.register()
    bpy.context.scene.grasp.address = f"http://{ADDRESS}"
    bpy.context.scene.grasp.budget = 5
    yield bpy.context.scene
    grasp_blender.unregister()


def settings():
    return bpy.context.scene.grasp


def client():
    return connect.Client(ADDRESS)


def imported(name, as_name):
    """A built-in object's mesh, whose importer turns the object, not the mesh; moved and turned."""
    bpy.ops.wm.obj_import(filepath=str(ROOT / f"assets/objects/{name}.obj"))
    bpy.ops.object.transform_apply()
    item = bpy.context.object
    item.name = as_name
    item.grasp.mass_kg, item.grasp.friction = 0.1, 0.6
    item.location, item.rotation_euler = (0.3, -0.2, 1.1), (0.5, 1.0, 2.0)
    bpy.context.view_layer.update()
    return item


def boxes(name, sizes=CHIRAL):
    """A mesh of boxes with one corner at the origin, +Z up."""
    vertices, faces = [], []
    for size in sizes:
        first = len(vertices)
        vertices += [tuple(size[axis] * (corner >> axis & 1) for axis in range(3)) for corner in range(8)]
        quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
        faces += [tuple(first + corner for corner in quad) for quad in quads]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    bpy.context.view_layer.update()
    return item


def found():
    """The grasp that is shown."""
    return json.loads(settings().found[settings().chosen].json)


def in_world(item, point):
    """A point of an object's frame in Blender's world, in its units."""
    return scenes.frame(item) @ (Vector(BLENDER.point_from_openxr(point)) * scenes.units_per_meter(bpy.context))


def meters(a, b):
    return (Vector(a) - Vector(b)).length * bpy.context.scene.unit_settings.scale_length


def surface(item):
    """The evaluated mesh of an object in the world."""
    bpy.context.view_layer.update()
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    return BVHTree.FromPolygons([evaluated.matrix_world @ v.co for v in mesh.vertices], [p.vertices for p in mesh.polygons])


def shown(role):
    """The armature that is shown of a role."""
    armatures = [item for item in bpy.data.objects if item.get("grasp_hand", "").startswith(role)]
    return next((armature for armature in armatures if not armature.hide_viewport), None)


def assert_posed(item, armature, joints):
    """Every bone is at its joint, within 0.1 mm and 0.1 degrees."""
    bpy.context.view_layer.update()
    for name, joint in list(zip(kinematics.JOINT_NAMES, joints, strict=True))[1:]:
        bone = armature.matrix_world @ armature.pose.bones[name].matrix
        assert meters(bone.to_translation(), in_world(item, joint[0])) < 1e-4, name
        wanted = scenes.frame(item) @ scenes.matrix(bpy.context, joint)
        assert bone.to_quaternion().rotation_difference(wanted.to_quaternion()).angle % (2 * math.pi) < 0.002, name


def assert_touches(item, armature, grasp):
    """The contacts lie on the object within 0.1 mm. Those of fingertips are no more than 1 mm outside of the skin, and no more
    than 3 mm inside, of which flesh yields by 2; others may be a few millimeters off, where the skin folds."""
    mesh, skin = surface(item), surface(next(child for child in armature.children if child.type == "MESH"))
    assert grasp["contacts"]
    for contact in grasp["contacts"]:
        point = in_world(item, contact["position"])
        assert meters(point, mesh.find_nearest(point)[0]) < 1e-4
        nearest, normal, _, _ = skin.find_nearest(point)
        outside = meters(point, nearest) * (1 if (point - nearest).dot(normal) > 0 else -1)
        fold = 0 if contact["phalanx"] == 3 else 4e-3
        assert -3e-3 - fold < outside < 1e-3 + fold, (contact["digit"], contact["phalanx"], outside)
