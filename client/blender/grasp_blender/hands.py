"""Hands in Blender's scene: the built-in ones with their skin, and armatures that givers and receivers have."""

import math
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
_ROLE, _SIZE = "grasp_hand", "grasp_size"


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
    """The armature and the skin in a file; the selection stays."""
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
        turned = bone.matrix @ Matrix.Rotation(-math.pi / 2, 4, "X")
        bone.matrix = turned
        bone.length = length
    bpy.ops.object.mode_set(mode="OBJECT")
    context.view_layer.objects.active = active


def pose_joints(context, armature, joints, scale=1.0):
    """Poses a built-in hand, which is at an object, like 26 joints in that object's frame: the armature is at the wrist.
    Returns what moved."""
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
    return [armature, *armature.pose.bones]


def pose_model(context, armature, at, hand, elbow=None):
    """Poses the user's armature, from which the hand's rig was created, at an object: an armature without an arm moves as a whole;
    the arm of a character bends, with the elbow toward a point in the object's frame. Returns what moved, bones first."""
    (root, root_pose), nodes = hand["model"][0], hand["model"][1:]
    bones, moved, size = armature.pose.bones, [], hand.get("scale", 1.0)
    for name, (x, y, z, w) in nodes:
        if (bone := bones.get(name)) is not None and bone.parent is not None:
            moved.append(bone)
            bone.rotation_mode = "QUATERNION"
            bone.rotation_quaternion = _at_rest(bone).to_quaternion().inverted() @ Quaternion((w, x, y, z))
    # The root has the file's axes: only its place is turned to Blender's.
    position, (x, y, z, w) = root_pose
    position = Vector(position) * scenes.units_per_meter(context)
    wanted = Matrix.Rotation(math.pi / 2, 4, "X") @ Matrix.LocRotScale(position, Quaternion((w, x, y, z)), None)
    if _arm(bones[root]) is None:
        scale = armature.matrix_world.to_scale().x / armature.get(_SIZE, 1.0) * size
        armature[_SIZE] = size
        scenes.place(context, armature, at, wanted @ Matrix.Scale(scale, 4) @ bones[root].bone.matrix_local.inverted())
        return [*moved, armature]
    armature_from_object = armature.matrix_world.inverted() @ scenes.frame(at)
    place, turn, _ = (armature_from_object @ wanted).decompose()
    if elbow is not None:
        elbow = armature_from_object @ (Vector(BLENDER.point_from_openxr(elbow)) * scenes.units_per_meter(context))
    return moved + _bend_arm(context, armature, bones[root], Matrix.LocRotScale(place, turn, (size,) * 3), elbow)


def _bend_arm(context, armature, hand, wanted, elbow):
    """Poses forearm and upper arm so that a hand is at a matrix, all in the armature's space; returns the three bones."""
    forearm, upper = _arm(hand)
    evaluated = armature.evaluated_get(context.evaluated_depsgraph_get()).pose.bones
    above = evaluated[upper.parent.name].matrix if upper.parent else Matrix()
    shoulder, wrist = above @ _at_rest(upper).to_translation(), wanted.to_translation()
    lengths = _at_rest(forearm).to_translation().length, _at_rest(hand).to_translation().length
    ahead, straight = (wrist - shoulder).normalized(), (wrist - shoulder).length
    # The two bones and the line from shoulder to wrist are a triangle, whose plane the elbow decides.
    along = (lengths[0] ** 2 - lengths[1] ** 2 + straight**2) / (2 * straight)
    side = (elbow or evaluated[forearm.name].head) - shoulder
    side = (side - side.dot(ahead) * ahead).normalized()
    elbow = shoulder + along * ahead + math.sqrt(max(0.0, lengths[0] ** 2 - along**2)) * side
    for bone, below, target in ((upper, forearm, elbow), (forearm, hand, wrist)):
        at_rest = above @ _at_rest(bone)
        end = (at_rest @ _at_rest(below)).to_translation()
        swing = (end - at_rest.to_translation()).rotation_difference(target - at_rest.to_translation())
        posed = Matrix.LocRotScale(at_rest.to_translation(), swing @ at_rest.to_quaternion(), None)
        _set(bone, at_rest.inverted() @ posed)
        above = posed
    _set(hand, (above @ _at_rest(hand)).inverted() @ wanted)
    return [hand, forearm, upper]


def _at_rest(bone):
    """The rest pose of a bone in its parent."""
    return bone.parent.bone.matrix_local.inverted() @ bone.bone.matrix_local if bone.parent else bone.bone.matrix_local


def _set(bone, basis):
    bone.rotation_mode = "QUATERNION"
    bone.matrix_basis = basis


def _arm(hand):
    """The bones of forearm and upper arm above that of a hand, or None."""
    return hand.parent_recursive[:2] if len(hand.parent_recursive) >= 2 else None


def arm_of(context, armature, root):
    """The shoulder above the bone of a hand, in OpenXR's axes and the world, and the lengths of upper arm and forearm in meters;
    None without an arm."""
    hand, size = armature.pose.bones[root], 1 / scenes.units_per_meter(context)
    if _arm(hand) is None:
        return None
    forearm, upper = _arm(hand)
    shoulder, elbow, wrist = (armature.matrix_world @ bone.bone.head_local for bone in (upper, forearm, hand))
    posed = armature.matrix_world @ armature.evaluated_get(context.evaluated_depsgraph_get()).pose.bones[upper.name].head
    return BLENDER.point_to_openxr(tuple(posed * size)), (elbow - shoulder).length * size, (wrist - elbow).length * size


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
