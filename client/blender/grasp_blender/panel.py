"""The panel "Grasp" of the 3D view's sidebar."""

import bpy

from . import session
from .operators import OfKnown


class GraspPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Grasp"

    def begin(self, context):
        """A column of properties with their names beside them, and the settings."""
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        return self.layout.column(), context.scene.grasp


class GRASP_PT_server(GraspPanel, bpy.types.Panel):
    bl_label = "Server"

    def draw(self, context):
        column, settings = self.begin(context)
        column.prop(settings, "address")
        column.prop(settings, "timeout")
        row = column.row()
        row.label(text=context.window_manager.grasp_status or "Not called yet")
        row.operator("grasp.status")


class GRASP_PT_object(GraspPanel, bpy.types.Panel):
    bl_label = "Object"

    def draw(self, context):
        column, _ = self.begin(context)
        item = context.object
        if item is None or item.type != "MESH":
            column.label(text="Select a mesh object")
            return
        column.prop(item.grasp, "identifier", text="Name", placeholder=session.object_name(item).removeprefix("objects/"))
        column.prop(item.grasp, "mass_kg")
        column.prop(item.grasp, "friction")
        column.operator("grasp.upload")
        for warning in filter(None, item.grasp.warnings.splitlines()):
            column.label(text=warning, icon="ERROR")


class GRASP_PT_giver(GraspPanel, bpy.types.Panel):
    bl_label = "Giver"

    def draw(self, context):
        column, settings = self.begin(context)
        column.prop(settings, "giver")
        if settings.giver in ("FILE", "RECORDING"):
            column.prop(settings, "giver_file")
        if settings.giver == "ARMATURE":
            column.prop(settings, "giver_armature")
            column.prop(settings, "giver_hand")


class GRASP_PT_receiver(GraspPanel, bpy.types.Panel):
    bl_label = "Receiver"

    def draw(self, context):
        column, settings = self.begin(context)
        column.prop(settings, "hand")
        column.prop(settings, "scale")
        column.prop(settings, "armature")
        if settings.armature is not None:
            column.operator("grasp.create_rig")


class GRASP_UL_found(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_property):
        layout.label(text=item.type)
        layout.label(text=f"{item.score:.2f}")


class GRASP_UL_known(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_property):
        layout.label(text=item.name, icon="CHECKMARK" if item.preferred else "CANCEL")


class GRASP_PT_grasp(GraspPanel, bpy.types.Panel):
    bl_label = "Grasp"

    def draw(self, context):
        column, settings = self.begin(context)
        column.prop(settings, "budget")
        column.prop(settings, "alternatives")
        column.operator("grasp.find", icon="VIEW_PAN")
        if settings.found:
            self.layout.template_list("GRASP_UL_found", "", settings, "found", settings, "chosen", rows=2)
            self.layout.operator("grasp.keep")


class GRASP_PT_known(GraspPanel, bpy.types.Panel):
    bl_label = "Known Grips"

    def draw(self, context):
        column, _ = self.begin(context)
        column.operator("grasp.known", text="List")
        if OfKnown.poll(context):
            manager = context.window_manager
            column.template_list("GRASP_UL_known", "", manager, "grasp_known", manager, "grasp_known_at", rows=2)
            row = column.row(align=True)
            for operator in ("grasp.show_known", "grasp.prefer", "grasp.forget"):
                row.operator(operator)


class GRASP_PT_animation(GraspPanel, bpy.types.Panel):
    bl_label = "Animation"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, settings = self.begin(context)
        column.prop(settings, "key_length")
        column.operator("grasp.key")
        recorded = column.column()
        recorded.enabled = settings.giver == "RECORDING"
        recorded.operator("grasp.track")


class GRASP_PT_bake(GraspPanel, bpy.types.Panel):
    bl_label = "Folder"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, settings = self.begin(context)
        column.prop(settings, "folder")
        column.row().prop(settings, "formats")
        column.prop(settings, "mass_kg")
        column.prop(settings, "z_up")
        column.operator("grasp.bake")


CLASSES = (
    GRASP_PT_server,
    GRASP_PT_object,
    GRASP_PT_giver,
    GRASP_PT_receiver,
    GRASP_UL_found,
    GRASP_UL_known,
    GRASP_PT_grasp,
    GRASP_PT_known,
    GRASP_PT_animation,
    GRASP_PT_bake,
)
