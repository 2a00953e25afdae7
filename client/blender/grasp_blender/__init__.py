"""Grasp for Blender: hands that take objects, posed by a Grasp server.

The modules that do not need Blender (axes, bake, bones, connect, isaac, kinematics, messages, objects, recordings) may be
imported by any Python.
"""


def register():
    """Adds the panel, the operators and their properties to Blender."""
    from . import registration

    registration.register()


def unregister():
    """Takes them out again."""
    from . import registration

    registration.unregister()
