"""The add-on's classes in Blender."""

import bpy

from . import operators, panel, properties, steps

CLASSES = (*properties.CLASSES, *operators.CLASSES, *steps.CLASSES, *panel.CLASSES)


def register():
    """Adds them."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    properties.add()


def unregister():
    """Takes them out again."""
    properties.remove()
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
