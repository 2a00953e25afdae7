"""Hands in Blender's scene: the built-in ones with their skin, and armatures that givers and receivers have."""

import pathlib

import bpy
from mathutils import Matrix, Quaternion, Vector

from . import scenes
from .axes import BLENDER, composed, from_columns, inverse, product, rotated
from .bones import Bone, joint_bones
from .connect import GraspError
from .kinematics import FIRST_OF_DIGIT, JOINT_NAMES, PALM, TIP_OF_DIGIT, WRIST

_BESIDE = pathlib.Path(__file__).parent
# In the installed add-on, and in the repository.
_FOLDERS = (_BESIDE / "hands", _BESIDE.parents[2] / "assets/hands")
_SKINS = ("adult", "thesis")
_COLORS = {"giver": (0.16, 0.33, 0.65, 1.0), "receiver": (0.62, 0.36, 0.25, 1.0)}
# Where it is not a bone, the base of a finger's metacarpal lies this far from the wrist to the knuckle.
_METACARPAL = 1 / 3
# The thumb's base in the wrist's frame of a relaxed left hand.
_LEFT_THUMB = (-0.01946, -0.34358, -0.69103, 0.63565)
_ROLE = "grasp_hand"


def side(handedness):
    """ "left" or "right"."""
    return handedness.removeprefix("HANDEDNESS_").lower()


def built_in(context, role, handedness, rig):
    """The armature of a giver ("giver") or receiver; hands of rigs without a skin of their own get the adult's."""
    skin = rig.removeprefix("rigs/") if rig.removeprefix("rigs/") in _SKINS else _SKINS[0]
    key = f"{role} {side(handedness)} {skin}"
    for item in scenes.collection(context).objects:
        if item.get(_ROLE) == key:
            _show(item, True)
            return item
    file = next(folder / f"{skin}_{side(handedness)}.glb" for folder in _FOLDERS if folder.is_dir())
    armature, skinned = _imported(context, file)
    _turn_bones_along_fingers(context, armature)
    for item in (armature, skinned):
        for owner in list(item.users_collection):
            owner.objects.unlink(item)
        scenes.collection(context).objects.link(item)
        item.name = f"Grasp {role} {side(handedness)}" + (" skin" if item is skinned else "")
    armature[_ROLE] = key
    armature.data.display_type = "STICK"
    material = bpy.data.materials.get(f"Grasp {role}") or bpy.data.materials.new(f"Grasp {role}")
    material.diffuse_color = _COLORS[role]
    if material.node_tree is None:
        material.use_nodes = True
    if bsdf := material.node_tree.nodes.get("Principled BSDF"):
        bsdf.inputs["Base Color"].default_value = _COLORS[role]
        bsdf.inputs["Roughness"].default_value = 0.6
    skinned.data.materials.clear()
    skinned.data.materials.append(material)
    return armature


def hide_others(context, role, shown):
    """Hides the hands of a role but one, unless they are animated."""
    for item in scenes.collection(context).objects:
        if item.get(_ROLE, "").startswith(role) and item != shown and item.animation_data is None:
            _show(item, False)


def _show(armature, shown):
    for item in (armature, *armature.children):
        item.hide_viewport = item.hide_render = not shown


def _imported(context, file):
    """The armature and the skin in a file; what was selected stays so."""
    active, selected = context.view_layer.objects.active, list(context.selected_objects)
    if context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    before, units = set(bpy.data.objects), context.scene.unit_settings
    meters_per_unit, units.scale_length = units.scale_length, 1.0
    bpy.ops.import_scene.gltf(filepath=str(file), bone_heuristic="BLENDER", disable_bone_shape=True)
    units.scale_length = meters_per_unit
    new = set(bpy.data.objects) - before
    armature = next(item for item in new if item.type == "ARMATURE")
    skinned = next(item for item in new if item.type == "MESH" and item.parent == armature)
    for item in context.selected_objects:
        item.select_set(False)
    for item in selected:
        item.select_set(True)
    context.view_layer.objects.active = active
    return armature, skinned


def _turn_bones_along_fingers(context, armature):
    """Bones come with the axes of joints in OpenXR: those of joints in Blender are along the fingers."""
    active = context.view_layer.objects.active
    context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    for bone in armature.data.edit_bones:
        ahead = [child.head for child in bone.children]
        length = (ahead[len(ahead) // 2] - bone.head).length if ahead else 0.008
        turned = bone.matrix @ Matrix.Rotation(-1.5707963267948966, 4, "X")
        bone.matrix = turned
        bone.length = length
    bpy.ops.object.mode_set(mode="OBJECT")
    context.view_layer.objects.active = active


def pose_joints(context, armature, joints, scale=1.0):
    """Poses a built-in hand, which is at an object, like 26 joints in that object's frame: the armature is at the wrist.
    Returns what moved."""
    moved = [armature, *armature.pose.bones]
    before = [item.rotation_quaternion.copy() for item in moved]
    size = scale * scenes.units_per_meter(context)
    armature.matrix_basis = scenes.matrix(context, joints[WRIST]) @ Matrix.Scale(size, 4)
    armature_from_object = inverse(joints[WRIST])
    posed = {}
    for name, joint in zip(JOINT_NAMES, joints):
        if joint is not None:
            position, turn = composed(armature_from_object, joint)
            position, (x, y, z, w) = BLENDER.pose_from_openxr((tuple(part / scale for part in position), turn))
            posed[name] = Matrix.LocRotScale(Vector(position), Quaternion((w, x, y, z)), None)
    for bone in armature.pose.bones:
        if bone.name not in posed:
            # A digit that the rig does not have shrinks into the hand.
            bone.matrix_basis = Matrix.Scale(1e-4, 4)
            continue
        rest, pose = bone.bone.matrix_local, posed[bone.name]
        if bone.parent is not None and bone.parent.name in posed:
            rest = bone.parent.bone.matrix_local.inverted() @ rest
            pose = posed[bone.parent.name].inverted() @ pose
        bone.matrix_basis = rest.inverted() @ pose
    for item, last in zip(moved, before):
        # Of the two quaternions of a rotation, the one that keys reach the short way.
        if item.rotation_quaternion.dot(last) < 0:
            item.rotation_quaternion.negate()
    return moved



def pose_model(context, armature, at, hand):
    """Poses the user's armature, from which the hand's rig was created, at an object: its fingers, and the bone of the hand.

    An armature without an arm moves as a whole. The arm of a character follows the empty "Grasp LEFT" or "Grasp RIGHT" by an
    IK constraint that is named "Grasp". Returns what moved, the armature's bones first.
    """
    (root, root_pose), nodes = hand["model"][0], hand["model"][1:]
    size = hand.get("scale", 1.0)
    bones, moved = armature.pose.bones, []
    for name, turn in nodes:
        if (bone := bones.get(name)) is None or bone.parent is None:
            continue
        at_rest = (bone.parent.bone.matrix_local.inverted() @ bone.bone.matrix_local).to_quaternion()
        x, y, z, w = turn
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = at_rest.inverted() @ Quaternion((w, x, y, z))
        moved.append(bone)
    # The root has the file's axes: only its place in the world is turned to Blender's.
    position, (x, y, z, w) = root_pose
    axes = Matrix.Rotation(1.5707963267948966, 4, "X")
    wanted = axes @ Matrix.LocRotScale(
        Vector(position) * scenes.units_per_meter(context), Quaternion((w, x, y, z)), None
    )
    hand_bone = bones[root]
    if len(hand_bone.parent_recursive) < 2:
        scale = armature.matrix_world.to_scale().x / armature.get("grasp_scale", 1.0) * size
        armature["grasp_scale"] = size
        scenes.place(context, armature, at, wanted @ Matrix.Scale(scale, 4) @ hand_bone.bone.matrix_local.inverted())
        return [*moved, armature]
    name = f"Grasp {hand['handedness'].removeprefix('HANDEDNESS_')}"
    target = scenes.collection(context).objects.get(name) or bpy.data.objects.new(name, None)
    if name not in scenes.collection(context).objects:
        scenes.collection(context).objects.link(target)
        target.empty_display_size = 0.05 * scenes.units_per_meter(context)
    scenes.place(context, target, at, wanted)
    _constraint(hand_bone.parent, "IK", target).chain_count = 2
    _constraint(hand_bone, "COPY_ROTATION", target)
    return [*moved, target]


def _constraint(bone, kind, target):
    constraint = bone.constraints.get("Grasp") or bone.constraints.new(kind)
    constraint.name, constraint.target = "Grasp", target
    return constraint


def bones_of(armature):
    """The bones of an armature; a bone's custom property "joint" names the joint that its name does not say."""
    return [Bone(bone.name, bone.parent and bone.parent.name, bone.get("joint")) for bone in armature.data.bones]


def giver_of(context, armature, handedness, at):
    """A posed armature's hand as HandJoints in the frame of an object. Axes of joints follow from where they are."""
    if armature is None or armature.type != "ARMATURE":
        raise GraspError("invalid_argument", "Name the giver's armature")
    evaluated = armature.evaluated_get(context.evaluated_depsgraph_get())
    object_from_armature = scenes.frame(at).inverted() @ evaluated.matrix_world
    points = []
    for place in joint_bones(bones_of(armature), handedness):
        if place is not None:
            point = object_from_armature @ getattr(evaluated.pose.bones[place[0]], place[1])
            place = Vector(BLENDER.point_to_openxr(tuple(point / scenes.units_per_meter(context))))
        points.append(place)
    return {"handedness": handedness, "joints": [_joint(pose) for pose in oriented(points, handedness)]}


def _joint(pose):
    return {} if pose is None else {"pose": {"position": dict(zip("xyz", pose[0])), "orientation": dict(zip("xyzw", pose[1]))}}


def oriented(points, handedness):
    """The 26 joints in OpenXR's axes at the points of a hand, None where it has none; palm and metacarpals may be missing."""
    left = handedness == "HANDEDNESS_LEFT"
    wrist = points[WRIST]
    knuckles = [points[first + 1] for first in FIRST_OF_DIGIT[1:] if points[first + 1] is not None]
    lateral = (knuckles[0] - knuckles[-1]) * (1 if left else -1)

    def aimed(point, toward, across):
        z = (point - toward).normalized()
        x = (across - across.dot(z) * z).normalized()
        return tuple(point), from_columns(x, z.cross(x), z)

    joints = [None] * len(JOINT_NAMES)
    middle = points[FIRST_OF_DIGIT[2] + 1]
    joints[WRIST] = aimed(wrist, middle, lateral)
    thumb = _LEFT_THUMB if left else (_LEFT_THUMB[0], -_LEFT_THUMB[1], -_LEFT_THUMB[2], _LEFT_THUMB[3])
    thumb_axis = Vector(rotated(product(joints[WRIST][1], thumb), (1.0, 0.0, 0.0)))
    for first, tip in zip(FIRST_OF_DIGIT, TIP_OF_DIGIT):
        if points[tip] is None:
            continue
        line = points[first : tip + 1]
        if line[0] is None:
            line[0] = wrist.lerp(line[1], _METACARPAL)
        across = thumb_axis if first == FIRST_OF_DIGIT[0] else lateral
        for place, point in enumerate(line[:-1]):
            joints[first + place] = aimed(point, line[place + 1], across)
        joints[tip] = (tuple(line[-1]), joints[tip - 1][1])
    metacarpal = joints[FIRST_OF_DIGIT[2]]
    joints[PALM] = (tuple(Vector(metacarpal[0]).lerp(middle, 0.5)), metacarpal[1])
    return joints
