"""Operators that make one call or a few: each ends within the timeout of its calls."""

import base64
import json
import pathlib
import tempfile

import bpy
from bpy.props import BoolProperty, StringProperty

from . import bake, contacts, glb, hands, motion, objects, session
from .connect import GraspError
from .kinematics import JOINT_NAMES
from .messages import hand_message


class Asking:
    """An operator that reports its errors, with every wrong field."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        try:
            self.run(context)
        except GraspError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class OfMesh(Asking):
    """An operator on the active mesh."""

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"


class GRASP_OT_status(Asking, bpy.types.Operator):
    bl_idname = "grasp.status"
    bl_label = "Test"
    bl_description = "Calls the server"
    bl_options = {"REGISTER"}

    def run(self, context):
        context.window_manager.grasp_status = "No answer"
        page = session.client(context).call("ObjectService/ListObjects", {"pageSize": 1000})
        more = "+" if page.get("nextPageToken") else ""
        context.window_manager.grasp_status = f"Ready, {len(page.get('objects', ()))}{more} objects"


class GRASP_OT_upload(OfMesh, bpy.types.Operator):
    bl_idname = "grasp.upload"
    bl_label = "Send Object"
    bl_description = "Sends the active mesh with its modifiers, mass, friction and regions"

    def run(self, context):
        present = session.upload(context, context.object)
        self.report({"INFO"}, f"{present['name']}: {present['triangleCount']} triangles")


class GRASP_OT_find(OfMesh, bpy.types.Operator):
    bl_idname = "grasp.find"
    bl_label = "Find Grasp"
    bl_description = "Finds how a hand takes the active object, and shows it"

    def run(self, context):
        settings, item = context.scene.grasp, context.object
        session.upload(context, item)
        given = session.holdout(context, item)
        request = {
            "holdout": given.message,
            "receiver": session.receiver(context, given.convention, session.client_from_world(context, item, given)),
            "search": {"budget": f"{settings.budget:.3f}s"},
            "output": {"convention": given.convention},
        }
        grasps, reason = bake.find(session.client(context), request, settings.alternatives)
        if settings.giver in ("FILE", "RECORDING"):
            session.show_giver(context, item, given)
        else:
            hands.hide_others(context, "giver", None)
        settings.found.clear()
        settings.found_at = item
        for grasp in grasps:
            entry, shown = settings.found.add(), session.in_object(grasp, given)
            entry.type, entry.score, entry.json = shown["type"], shown["score"], json.dumps(shown)
        if not grasps:
            contacts.clear(context)
            hands.hide_others(context, "receiver", None)
            raise GraspError("not_found", reason)
        settings.chosen = 0


def chosen(context):
    """The grasp that is chosen in the list."""
    settings = context.scene.grasp
    if not 0 <= settings.chosen < len(settings.found) or settings.found_at is None:
        raise GraspError("failed_precondition", "Find a grasp first")
    return json.loads(settings.found[settings.chosen].json)


def show_chosen(context):
    """Shows the grasp that is chosen in the list."""
    settings = context.scene.grasp
    if 0 <= settings.chosen < len(settings.found) and settings.found_at is not None:
        show(context, settings.found_at, chosen(context))


def show(context, item, grasp):
    """Shows a grasp: hand, contacts and forces."""
    session.show_receiver(context, item, grasp["hand"], grasp["elbow"])
    contacts.show(context, item, grasp["contacts"])


class GRASP_OT_keep(OfMesh, bpy.types.Operator):
    bl_idname = "grasp.keep"
    bl_label = "Keep as Known Grip"
    bl_description = "Keeps the chosen grasp with its object on the server: it is tried before all others, or never answered"

    name: StringProperty(name="Name", default="grip", maxlen=63)
    preferred: BoolProperty(name="Preferred", description="Else banned", default=True)

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def run(self, context):
        item = context.scene.grasp.found_at
        grip = {"name": self.name, "preference": _preference(self.preferred), "hand": hand_message(chosen(context)["hand"])}

        def change(grips):
            return [known for known in grips if known["name"] != self.name] + [grip]

        present = objects.set_known_grips(session.client(context), session.object_name(item), change)
        session.list_known(context, present)


def _preference(preferred):
    return "PREFERENCE_PREFERRED" if preferred else "PREFERENCE_FORBIDDEN"


class GRASP_OT_known(OfMesh, bpy.types.Operator):
    bl_idname = "grasp.known"
    bl_label = "List Known Grips"
    bl_description = "Reads the active object's known grips from the server"
    bl_options = {"REGISTER"}

    def run(self, context):
        present = objects.find(session.client(context), session.object_name(context.object))
        session.list_known(context, present or {"name": session.object_name(context.object)})


class OfKnown(OfMesh):
    """An operator on the known grip that is chosen in the list."""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and _known(context) is not None


def _known(context):
    manager = context.window_manager
    listed = context.object is not None and manager.grasp_known_of == session.object_name(context.object)
    return manager.grasp_known[manager.grasp_known_at] if listed and manager.grasp_known_at < len(manager.grasp_known) else None


class GRASP_OT_prefer(OfKnown, bpy.types.Operator):
    bl_idname = "grasp.prefer"
    bl_label = "Prefer or Ban"
    bl_description = "Makes the known grip one to try first, or one that is never answered"
    bl_options = {"REGISTER"}

    def run(self, context):
        known = _known(context)

        def change(grips):
            changed = {"preference": _preference(not known.preferred)}
            return [grip | changed if grip["name"] == known.name else grip for grip in grips]

        session.list_known(context, objects.set_known_grips(session.client(context), session.object_name(context.object), change))


class GRASP_OT_forget(OfKnown, bpy.types.Operator):
    bl_idname = "grasp.forget"
    bl_label = "Remove"
    bl_description = "Removes the known grip from the object on the server"
    bl_options = {"REGISTER"}

    def run(self, context):
        name = _known(context).name

        def change(grips):
            return [grip for grip in grips if grip["name"] != name]

        session.list_known(context, objects.set_known_grips(session.client(context), session.object_name(context.object), change))


class GRASP_OT_show_known(OfKnown, bpy.types.Operator):
    bl_idname = "grasp.show_known"
    bl_label = "Show"
    bl_description = "Shows the known grip, and whether it is valid with the giver"

    def run(self, context):
        item = context.object
        session.upload(context, item)
        given = session.holdout(context, item)
        grip = json.loads(_known(context).json)
        request = {"holdout": given.message, "pose": grip["hand"], "output": {"convention": given.convention}}
        answer = session.client(context).call("GraspService/ValidateGrasp", request)
        show(context, item, session.in_object(answer["grasp"], given))
        failed = [verdict["description"] for verdict in answer["verdicts"] if not verdict.get("passed")]
        self.report({"WARNING" if failed else "INFO"}, "\n".join(failed) or f"{grip['name']} is valid")


class GRASP_OT_key(Asking, bpy.types.Operator):
    bl_idname = "grasp.key"
    bl_label = "Key Motion"
    bl_description = "Keys the hand from the current frame on: drawn back, open at the object, closed"

    def run(self, context):
        settings, grasp = context.scene.grasp, chosen(context)
        if not grasp["keyFrames"]:
            raise GraspError("not_found", "No free way leads to this grasp")
        show(context, settings.found_at, grasp)
        keys, frame = motion.Keys(), context.scene.frame_current
        for _, hand in grasp["keyFrames"]:
            keys.add(session.show_receiver(context, settings.found_at, hand, grasp["elbow"]), frame)
            frame += settings.key_length
        keys.make_linear()


class GRASP_OT_create_rig(Asking, bpy.types.Operator):
    bl_idname = "grasp.create_rig"
    bl_label = "Create Rig"
    bl_description = "Sends the armature of Own Hand with its skin: then grasps are those of its hands"

    def run(self, context):
        armature = context.scene.grasp.armature
        if armature is None:
            raise GraspError("failed_precondition", "Name an armature under Own Hand")
        name = objects.object_name(armature.name).removeprefix("objects/")
        request = {"rigId": name, "models": [base64.b64encode(_glb_of(context, armature)).decode()]}
        hand = context.scene.grasp.hand
        if hand != "HANDEDNESS_UNSPECIFIED":
            request["handedness"] = hand
        request["jointMap"] = [
            {"node": bone.name, "joint": bone.joint} for bone in hands.bones_of(armature) if bone.joint in JOINT_NAMES
        ]
        server = session.client(context)
        if session.rig_of(armature) == f"rigs/{name}":
            try:
                server.call("HandRigService/DeleteRig", {"name": f"rigs/{name}"})
            except GraspError as error:
                if error.code != "not_found":
                    raise
        try:
            rig = server.call("HandRigService/CreateRig", request)
        except GraspError as error:
            # A rig of that name from elsewhere stays.
            if error.code == "already_exists":
                raise GraspError(error.code, f"rigs/{name} is another armature's: rename this one") from None
            raise
        session.set_rig(armature, rig)
        for warning in rig.get("warnings", ()):
            self.report({"WARNING"}, warning)


def _glb_of(context, armature):
    """A GLB file of an armature at rest with its skins, in meters."""
    skins = [item for item in context.view_layer.objects if item.type == "MESH" and item.find_armature() == armature]
    if not skins:
        raise GraspError("invalid_argument", f"{armature.name} has no skin")
    active, selected = context.view_layer.objects.active, list(context.selected_objects)
    for item in context.view_layer.objects:
        item.select_set(item in (armature, *skins))
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "hand.glb"
        bpy.ops.export_scene.gltf(
            filepath=str(file),
            use_selection=True,
            export_animations=False,
            export_materials="NONE",
            export_texcoords=False,
            export_morph=False,
            export_rest_position_armature=True,
        )
        content = file.read_bytes()
    for item in context.view_layer.objects:
        item.select_set(item in selected)
    context.view_layer.objects.active = active
    return glb.scaled(content, context.scene.unit_settings.scale_length)


CLASSES = (
    GRASP_OT_status,
    GRASP_OT_upload,
    GRASP_OT_find,
    GRASP_OT_keep,
    GRASP_OT_known,
    GRASP_OT_prefer,
    GRASP_OT_forget,
    GRASP_OT_show_known,
    GRASP_OT_key,
    GRASP_OT_create_rig,
)
