"""What operators ask the server for, with the panel's settings."""

import json
import math
import urllib.parse

import bpy

from . import hands, objects, recordings, scenes
from .axes import CONVENTIONS, IDENTITY, composed, inverse
from .connect import Client, GraspError
from .messages import grasp_in_object, vector_json

_LOOPBACK = ("localhost", "127.0.0.1", "::1")
_RIG, _HANDS = "grasp_rig", "grasp_hands"


def client(context):
    """The server of the scene."""
    settings = context.scene.grasp
    server = Client(settings.address, settings.timeout)
    if urllib.parse.urlsplit(server.address).hostname not in _LOOPBACK and not bpy.app.online_access:
        raise GraspError("unavailable", "Allow Online Access in Preferences > System to call a server on another machine")
    return server


def object_name(item):
    """An object's name on the server."""
    return objects.object_name(item.grasp.identifier or item.name)


def upload(context, item):
    """Makes the server have the object as it is in the scene; returns it as on the server."""
    mesh, regions = scenes.mesh_of(context, item)
    wanted = {"name": object_name(item), "massKg": item.grasp.mass_kg, "friction": item.grasp.friction, "regions": regions}
    present = objects.ensure(client(context), wanted, mesh)
    item.grasp.warnings = "\n".join(present.get("warnings", ()))
    list_known(context, present)
    return present


def list_known(context, present):
    """Lists an object's known grips in the panel."""
    manager = context.window_manager
    manager.grasp_known_of = present["name"]
    manager.grasp_known.clear()
    for grip in present.get("knownGrips", ()):
        entry = manager.grasp_known.add()
        entry.name, entry.preferred = grip["name"], grip["preference"] == "PREFERENCE_PREFERRED"
        entry.json = json.dumps(grip)


def recording(context):
    """The recorded motion of the settings."""
    return recordings.read_recording(bpy.path.abspath(context.scene.grasp.giver_file))


def time(context):
    """Seconds from the scene's first frame to the current one."""
    scene = context.scene
    return (scene.frame_current - scene.frame_start) * scene.render.fps_base / scene.render.fps


def holdout(context, item):
    """The giver of the settings at an object of the scene, with the object's name on the server. Unless a file says where the
    object is, the client's frame is the object's, and up is the scene's."""
    settings = context.scene.grasp
    if settings.giver == "FILE":
        given = recordings.read_giver(bpy.path.abspath(settings.giver_file))
    elif settings.giver == "RECORDING":
        given = recording(context).holdout_at(time(context))
    else:
        message = {}
        if settings.giver == "ARMATURE":
            giver = hands.giver_of(context, settings.giver_armature, settings.giver_hand, item)
            message["presentingHand"] = {"joints": giver}
        given = recordings.Holdout(message, "CONVENTION_OPENXR")
    message = {**given.message, "object": object_name(item)}
    if "clientFromObject" not in message and "up" not in message:
        message["up"] = vector_json(CONVENTIONS[given.convention].direction_from_openxr(scenes.up(context, item)))
    return given._replace(message=message)


def receiver(context, convention="CONVENTION_OPENXR", client_from_world=None):
    """The receiver of the settings; a character's has its arm, if the pose of Blender's world in the client's frame is given, in
    OpenXR's axes."""
    settings = context.scene.grasp
    message = {"handedness": settings.hand, "scale": settings.scale}
    if (own := settings.armature) is None:
        return message
    if _RIG not in own:
        raise GraspError("failed_precondition", f"Create Rig first: no rig is known of {own.name}")
    message["rig"], roots = own[_RIG], own[_HANDS].to_dict()
    arms = {
        side: hands.arm_of(context, own, root)
        for side, root in roots.items()
        if settings.hand in (side, "HANDEDNESS_UNSPECIFIED")
    }
    if not arms:
        raise GraspError("invalid_argument", f"{own.name} has no {hands.side(settings.hand)} hand")
    if client_from_world is None or None in arms.values():
        return message | ({"handedness": next(iter(arms))} if len(arms) == 1 else {})
    # A shoulder is that of one hand: the nearer one.
    engine, at = CONVENTIONS[convention], scenes.pose_of(context, scenes.frame(context.object))[0]
    side = min(arms, key=lambda side: math.dist(arms[side][0], at))
    shoulder, upper, forearm = arms[side]
    client_shoulder = engine.point_from_openxr(composed(client_from_world, (shoulder, IDENTITY[1]))[0])
    lengths = {"upperArmLength": upper * engine.units_per_meter, "forearmLength": forearm * engine.units_per_meter}
    return message | {"handedness": side, "clientShoulder": vector_json(client_shoulder), **lengths}


def client_from_world(context, item, given):
    """The pose of Blender's world in the frame of a client to whom an object is held out, in OpenXR's axes."""
    return composed(given.client_from_object(), inverse(scenes.pose_of(context, scenes.frame(item))))


def rig_of(armature):
    """The name of the rig that was created from an armature, or None."""
    return armature.get(_RIG)


def set_rig(armature, rig):
    """Notes the rig that was created from an armature, and the bones that are its hands."""
    armature[_RIG] = rig["name"]
    armature[_HANDS] = {side["handedness"]: side["nodes"][0]["node"] for side in rig["hands"] if side.get("nodes")}


def show_giver(context, item, given):
    """Shows the giver of a file or a recording at an object, unless it is a mesh; returns what moved."""
    handedness, joints = recordings.giver_joints(client(context), given)
    if not joints or joints[1] is None:
        hands.hide_others(context, "giver", None)
        return []
    if joints[0] is None:
        # WebXR has no palm, which is no bone either.
        joints[0] = joints[1]
    rig = given.message["presentingHand"].get("pose", {}).get("rig", "")
    return _pose_built_in(context, item, "giver", {"handedness": handedness, "rig": rig, "joints": joints})


def show_receiver(context, item, hand, elbow=None):
    """Shows a receiving hand at an object, and the elbow of its arm; returns what moved, an armature or its bones first."""
    own = context.scene.grasp.armature
    if hand.get("model") and own is not None and own.get(_RIG) == hand["rig"]:
        hands.hide_others(context, "receiver", None)
        return hands.pose_model(context, own, item, hand, elbow)
    return _pose_built_in(context, item, "receiver", hand)


def _pose_built_in(context, item, role, hand):
    armature = hands.built_in(context, role, hand["handedness"], hand["rig"])
    hands.hide_others(context, role, armature)
    scenes.place(context, armature, item, scenes.Matrix())
    return hands.pose_joints(context, armature, hand["joints"], hand.get("scale", 1.0))


def move(context, item, given):
    """Moves an object to where a giver holds it, in the giver's frame; returns it."""
    scale = scenes.frame(item).inverted() @ item.matrix_world
    item.matrix_world = scenes.matrix(context, given.client_from_object()) @ scale
    context.view_layer.update()
    return item


def in_object(grasp, given):
    """A grasp of an answer to a holdout, in OpenXR's axes and the object's frame."""
    return grasp_in_object(grasp, given.convention, given.client_from_object())

