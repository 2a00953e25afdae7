"""Settings of the panel, and the results that it shows."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

_SIDES = [("HANDEDNESS_LEFT", "Left", "The left hand"), ("HANDEDNESS_RIGHT", "Right", "The right hand")]
_EITHER = [("HANDEDNESS_UNSPECIFIED", "Either", "The better of both"), *_SIDES]
_GIVERS = [
    ("NONE", "Nobody", "Nobody holds the object"),
    ("FILE", "File", "A hand in a JSON file: a HandPose, HandJoints, a holdout, or a request with one"),
    ("ARMATURE", "Armature", "A hand of an armature in the scene, as it is posed"),
    ("RECORDING", "Recording", "A recorded motion, at the current frame"),
]
_FORMATS = [
    ("json", "JSON", "NAME.grasps.json: the server's messages", 1),
    ("isaac", "Isaac Sim", "NAME.grasps.left.yaml and NAME.grasps.right.yaml: isaac_grasp 1.0", 2),
]


def _is_armature(_, item):
    return item.type == "ARMATURE"


def _chosen(settings, context):
    from .operators import show_chosen

    show_chosen(context)


class GraspFound(bpy.types.PropertyGroup):
    """A grasp that was found."""

    type: StringProperty()
    score: FloatProperty()
    json: StringProperty()


class GraspKnown(bpy.types.PropertyGroup):
    """A known grip of the active object, as it is on the server."""

    preferred: BoolProperty()
    json: StringProperty()


class GraspObjectSettings(bpy.types.PropertyGroup):
    """How an object is held out."""

    identifier: StringProperty(name="Name", description="Last part of the object's name on the server; empty: as in Blender")
    mass_kg: FloatProperty(name="Mass", description="Kilograms", default=0.2, min=0.001, soft_max=10.0, max=1000.0)
    friction: FloatProperty(name="Friction", description="Of dry skin on its surface", default=0.6, min=0.01, max=5.0)
    warnings: StringProperty(description="What the server repaired or doubts")


class GraspSettings(bpy.types.PropertyGroup):
    """Who gives, who takes, and how."""

    address: StringProperty(name="Server", description="Address of the Grasp server", default="http://[::1]:50051")
    timeout: FloatProperty(
        name="Timeout", description="Longest time for a call", default=10.0, min=0.5, max=120.0, subtype="TIME_ABSOLUTE"
    )

    giver: EnumProperty(name="Giver", description="Who holds the object out", items=_GIVERS)
    giver_file: StringProperty(name="File", description="A hand or a recording in JSON", subtype="FILE_PATH")
    giver_armature: PointerProperty(name="Armature", type=bpy.types.Object, poll=_is_armature)
    giver_hand: EnumProperty(name="Hand", description="The hand that holds the object", items=_SIDES, default="HANDEDNESS_RIGHT")

    hand: EnumProperty(name="Hand", description="The hand that takes the object", items=_EITHER)
    scale: FloatProperty(name="Size", description="The hand's size over its rig's", default=1.0, min=0.5, max=2.0)
    armature: PointerProperty(
        name="Own Hand",
        description="A character's armature, after Create Rig; empty: the built-in hand",
        type=bpy.types.Object,
        poll=_is_armature,
    )
    budget: FloatProperty(
        name="Budget", description="Longest time for a search", default=1.0, min=0.001, max=60.0, subtype="TIME_ABSOLUTE"
    )
    alternatives: IntProperty(name="Grasps", description="Number of grasps that differ by side and type", default=1, min=1, max=32)

    found: CollectionProperty(type=GraspFound)
    found_at: PointerProperty(type=bpy.types.Object)
    chosen: IntProperty(name="Grasp", description="The grasp that is shown", update=_chosen, options=set())

    key_length: IntProperty(name="Frames", description="Frames from each key to the next", default=12, min=1)
    folder: StringProperty(name="Folder", description="Of OBJ, STL, PLY, GLB and glTF files", subtype="DIR_PATH")
    formats: EnumProperty(name="Formats", items=_FORMATS, options={"ENUM_FLAG"}, default={"json"})
    mass_kg: FloatProperty(name="Mass", description="Of each object without a NAME.toml", default=0.2, min=0.001, max=1000.0)
    z_up: BoolProperty(name="OBJ, PLY and STL are Z up", description="Unless NAME.toml says so")


CLASSES = (GraspFound, GraspKnown, GraspObjectSettings, GraspSettings)


def add():
    """Adds the properties to Blender's types."""
    bpy.types.Scene.grasp = PointerProperty(type=GraspSettings)
    bpy.types.Object.grasp = PointerProperty(type=GraspObjectSettings)
    # The server's state, which undo does not change, and files do not keep.
    manager = bpy.types.WindowManager
    manager.grasp_known = CollectionProperty(type=GraspKnown)
    manager.grasp_known_of = StringProperty()
    manager.grasp_known_at = IntProperty(name="Known grip", options=set())
    manager.grasp_status = StringProperty()


def remove():
    """Takes them out again."""
    del bpy.types.Scene.grasp, bpy.types.Object.grasp
    manager = bpy.types.WindowManager
    del manager.grasp_known, manager.grasp_known_of, manager.grasp_known_at, manager.grasp_status
