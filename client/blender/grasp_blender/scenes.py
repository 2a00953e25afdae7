"""Places of things in Blender's scene: meshes as the server gets them, and the markers at an object."""

import bpy
import numpy
from mathutils import Matrix, Quaternion, Vector

from . import glb
from .axes import BLENDER
from .connect import GraspError

PREFERENCES = ("forbidden", "avoided", "preferred")
COLLECTION = "Grasp"
# The corners of a triangle have at least this weight in a vertex group that marks it.
_LEAST_WEIGHT = 0.5


def units_per_meter(context):
    """Blender's units in a meter of this scene."""
    return 1.0 / context.scene.unit_settings.scale_length


def matrix(context, pose):
    """A pose in OpenXR's axes and meters as a matrix in Blender's axes and units."""
    position, (x, y, z, w) = BLENDER.pose_from_openxr(pose)
    return Matrix.LocRotScale(Vector(position) * units_per_meter(context), Quaternion((w, x, y, z)), None)


def pose_of(context, matrix):
    """The pose in OpenXR's axes and meters of a matrix without scale."""
    position, turn = matrix.to_translation() / units_per_meter(context), matrix.to_quaternion()
    return BLENDER.pose_to_openxr((tuple(position), (turn.x, turn.y, turn.z, turn.w)))


def frame(item):
    """An object's frame as the server has it: its place and rotation in the world. Its scale is part of its mesh."""
    location, rotation, _ = item.matrix_world.decompose()
    return Matrix.LocRotScale(location, rotation, None)


def up(context, item):
    """The world's +Z in the object's frame, in OpenXR's axes."""
    return BLENDER.direction_to_openxr(tuple(frame(item).to_quaternion().inverted() @ Vector((0, 0, 1))))


def place(context, item, at, matrix):
    """Puts `item` at a matrix in an object's frame, from where it follows that object."""
    item.parent = at
    item.matrix_parent_inverse = at.matrix_world.inverted() @ frame(at)
    item.rotation_mode = "QUATERNION"
    item.matrix_basis = matrix


def collection(context):
    """The collection of everything that the add-on shows."""
    shown = bpy.data.collections.get(COLLECTION) or bpy.data.collections.new(COLLECTION)
    if COLLECTION not in context.scene.collection.children:
        context.scene.collection.children.link(shown)
    return shown


def mesh_of(context, item):
    """An object's mesh with its modifiers as (GLB file, regions): OpenXR's axes and meters, with the object's scale.

    Faces are marked by a boolean attribute of faces, or by a vertex group, of the name of a preference.
    """
    if item is None or item.type != "MESH":
        raise GraspError("invalid_argument", "Select a mesh object")
    if item.mode == "EDIT":
        item.update_from_editmode()
    evaluated = item.evaluated_get(context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=context.evaluated_depsgraph_get())
    try:
        mesh.calc_loop_triangles()
        if not mesh.loop_triangles:
            raise GraspError("invalid_argument", f"{item.name} has no faces")
        corners = numpy.empty(3 * len(mesh.loop_triangles), numpy.int32)
        mesh.loop_triangles.foreach_get("vertices", corners)
        corners = corners.reshape(-1, 3)
        points = numpy.empty(3 * len(mesh.vertices), numpy.float32)
        mesh.vertices.foreach_get("co", points)
        scale = (frame(item).inverted() @ item.matrix_world).to_3x3() * (1 / units_per_meter(context))
        points = points.reshape(-1, 3).astype(numpy.float64) @ numpy.array(scale).T
        points = numpy.stack(BLENDER.direction_to_openxr(points.T), axis=-1)
        regions = _regions(evaluated, mesh, corners)
        if scale.determinant() < 0:
            corners = corners[:, ::-1]
        return glb.triangles(points.astype(numpy.float32), corners.astype(numpy.uint32)), regions
    finally:
        evaluated.to_mesh_clear()


def _regions(evaluated, mesh, corners):
    regions = []
    for preference in PREFERENCES:
        marked = numpy.zeros(len(corners), bool)
        attribute = mesh.attributes.get(preference)
        if attribute is not None and (attribute.domain, attribute.data_type) == ("FACE", "BOOLEAN"):
            faces = numpy.empty(len(mesh.polygons), bool)
            attribute.data.foreach_get("value", faces)
            of_triangle = numpy.empty(len(corners), numpy.int32)
            mesh.loop_triangles.foreach_get("polygon_index", of_triangle)
            marked |= faces[of_triangle]
        if (group := evaluated.vertex_groups.get(preference)) is not None:
            weights = numpy.zeros(len(mesh.vertices))
            for vertex in mesh.vertices:
                weights[vertex.index] = next((part.weight for part in vertex.groups if part.group == group.index), 0)
            marked |= (weights[corners] >= _LEAST_WEIGHT).all(axis=1)
        if marked.any():
            triangles = numpy.flatnonzero(marked).tolist()
            regions.append({"name": preference, "preference": f"PREFERENCE_{preference.upper()}", "triangles": triangles})
    return regions

