"""Operators that make many calls: in the window, a few per tick of a timer with the progress shown; Escape ends them."""

import pathlib
import time

import bpy

from . import bake, motion, session
from .axes import IDENTITY
from .connect import GraspError
from .operators import Asking, OfMesh
from .recordings import Holdout

# Seconds of work between two looks at the window.
_TICK = 0.05
_NAVIGATION = {"MOUSEMOVE", "MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE"}


class Stepped(Asking):
    """An operator whose `steps` yields, after each call, the share of the work that is done."""

    def execute(self, context):
        try:
            for _ in self.steps(context):
                pass
        except GraspError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def invoke(self, context, event):
        self._steps = self.steps(context)
        self._timer = context.window_manager.event_timer_add(_TICK, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self._steps.close()
            return self._ended(context, {"CANCELLED"})
        if event.type != "TIMER":
            # Nothing may change what the steps hold; the view may turn.
            return {"PASS_THROUGH"} if event.type in _NAVIGATION else {"RUNNING_MODAL"}
        end = time.monotonic() + _TICK
        try:
            while time.monotonic() < end:
                context.window_manager.progress_update(100 * next(self._steps))
            return {"RUNNING_MODAL"}
        except StopIteration:
            return self._ended(context, {"FINISHED"})
        except GraspError as error:
            self.report({"ERROR"}, str(error))
            return self._ended(context, {"CANCELLED"})
        except Exception:
            self._ended(context, {"CANCELLED"})
            raise

    def _ended(self, context, result):
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        return result


class GRASP_OT_bake(Stepped, bpy.types.Operator):
    bl_idname = "grasp.bake"
    bl_label = "Bake Folder"
    bl_description = "Writes grasps beside every OBJ, STL, PLY, GLB and glTF file of a folder"
    bl_options = {"REGISTER"}

    def steps(self, context):
        settings = context.scene.grasp
        folder = pathlib.Path(bpy.path.abspath(settings.folder))
        if not settings.folder or not folder.is_dir():
            raise GraspError("invalid_argument", f"{settings.folder or 'Folder'} is no folder")
        files = bake.meshes(folder)
        if not files:
            raise GraspError("invalid_argument", f"{folder} has no meshes")
        request = {"receiver": session.receiver(context), "search": {"budget": f"{settings.budget:.3f}s"}}
        defaults = {"massKg": settings.mass_kg, "zUp": settings.z_up}
        baked = bake.bake(session.client(context), folder, defaults, request, settings.alternatives, settings.formats)
        failures = 0
        for index, (file, count, reason) in enumerate(baked):
            if reason:
                failures += 1
                self.report({"WARNING"}, f"{file.name}: {reason}")
            yield (index + 1) / len(files)
        self.report({"INFO"}, f"{len(files) - failures} of {len(files)} files have grasps")


class GRASP_OT_track(Stepped, OfMesh, bpy.types.Operator):
    bl_idname = "grasp.track"
    bl_label = "Key Recording"
    bl_description = "Plays the recording with the active object, and keys object, giver and the hand that takes it"

    def steps(self, context):
        scene, item = context.scene, context.object
        recording = session.recording(context)
        session.upload(context, item)
        server, name = session.client(context), session.object_name(item)
        begun = {key: value for key, value in recording.track.items() if key not in ("name", "output", "predictionHorizon")}
        begun |= {
            "holdout": {key: value for key, value in recording.track["holdout"].items() if key == "up"} | {"object": name},
            # The recording's frame is the world's.
            "receiver": session.receiver(context, recording.convention(), IDENTITY),
            "output": {"convention": recording.convention()},
            # Nobody waits for frames here.
            "search": {"budget": f"{scene.grasp.budget:.3f}s", **recording.track.get("search", {})},
        }
        track = server.call("GraspService/CreateTrack", begun)["name"]
        keys, receivers, without, warned = motion.Keys(), set(), 0, set()
        try:
            for index, (seconds, frame) in enumerate(recording.frames):
                given = Holdout({**frame.get("holdout", {}), "object": name}, recording.convention())
                pushed = {**frame, "track": track, "sequence": index + 1, "holdout": given.message}
                answer = server.call("GraspService/PushFrame", pushed)
                at = scene.frame_start + seconds * scene.render.fps / scene.render.fps_base
                keys.add([session.move(context, item, given)], at)
                keys.add(session.show_giver(context, item, given), at)
                taking = None
                if "grasp" in answer:
                    grasp = session.in_object(answer["grasp"], given)
                    moved = session.show_receiver(context, item, grasp["hand"], grasp["elbow"])
                    keys.add(moved, at)
                    taking = moved[0].id_data
                    receivers.add(taking)
                without += taking is None
                for armature in receivers:
                    keys.add_shown(armature, armature == taking, at)
                for warning in set(answer.get("warnings", ())) - warned:
                    warned.add(warning)
                    self.report({"WARNING"}, warning)
                yield (index + 1) / len(recording.frames)
        finally:
            server.call("GraspService/DeleteTrack", {"name": track})
        if without:
            self.report({"WARNING"}, f"{without} of {len(recording.frames)} frames have no grasp: the hand is hidden there")


CLASSES = (GRASP_OT_bake, GRASP_OT_track)
