"""Contacts and forces of a grasp, as empties at its object."""

import bpy
from mathutils import Matrix, Vector

from . import scenes
from .axes import BLENDER

# An arrow's meters per newton, and a contact's radius in meters.
_PER_NEWTON = 0.01
_RADIUS = 0.003
_MARK = "grasp_contact"


def show(context, item, contacts):
    """Shows the contacts of a grasp in place of those shown before; arrows end where the hand presses."""
    clear(context)
    size = scenes.units_per_meter(context)
    for contact in contacts:
        digit = contact["digit"].removeprefix("DIGIT_").lower().replace("unspecified", "palm")
        position = Vector(BLENDER.point_from_openxr(contact["position"])) * size
        force = Vector(BLENDER.direction_from_openxr(contact["force"])) * _PER_NEWTON * size
        _empty(context, item, f"Grasp contact {digit}", "SPHERE", _RADIUS * size, Matrix.Translation(position))
        if force.length > 0:
            turn = force.to_track_quat("Z", "Y").to_matrix().to_4x4()
            start = Matrix.Translation(position - force) @ turn
            _empty(context, item, f"Grasp force {digit}", "SINGLE_ARROW", force.length, start)


def clear(context):
    """Removes the contacts that are shown."""
    for item in list(scenes.collection(context).objects):
        if _MARK in item:
            bpy.data.objects.remove(item)


def _empty(context, at, name, kind, size, matrix):
    empty = bpy.data.objects.new(name, None)
    empty.empty_display_type, empty.empty_display_size = kind, size
    empty[_MARK] = True
    empty.hide_select = True
    scenes.collection(context).objects.link(empty)
    scenes.place(context, empty, at, matrix)
