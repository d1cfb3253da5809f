"""The sidebars' panels in the Image Editor and in the 3D Viewport, their settings and operators."""

import os

import bpy

from . import pictures, scene_3d
from .card import card_of
from .composite import composited, loaded, matte_files
from .rays import read_rays

_IMAGE = "Glasswing"


class GlasswingPicture(bpy.types.PropertyGroup):
    """The picture on one monitor; `name` is the monitor's."""

    image: bpy.props.PointerProperty(
        type=bpy.types.Image, name="Picture", description="A still, sequence or movie; stretched over the monitor")
    offset: bpy.props.FloatVectorProperty(name="Offset", size=2, description="Monitor px, right and down")
    scale: bpy.props.FloatProperty(
        name="Scale", default=1.0, min=0.01, max=100.0, description="About the monitor's centre")
    frame_offset: bpy.props.IntProperty(
        name="Frame Offset", description="Frames by which a sequence or movie is ahead")


class GlasswingSettings(bpy.types.PropertyGroup):
    matte: bpy.props.StringProperty(
        name="Matte", subtype="FILE_PATH", description="An .exr from glasswing fetch, or a directory of them for a video")
    pictures: bpy.props.CollectionProperty(type=GlasswingPicture)
    view: bpy.props.EnumProperty(
        name="View",
        items=[
            ("CAMERA", "Camera", "The whole picture that the rig's camera would have taken"),
            ("OBJECT", "Object", "The object alone, premultiplied, to put over something"),
            ("FOOTAGE", "Over Footage", "The first monitor's picture with the object in it, moved and scaled"),
        ],
    )
    object_offset: bpy.props.FloatVectorProperty(
        name="Object At", size=2, description="Top-left corner of the matte's picture in the footage, px right and down")
    object_scale: bpy.props.FloatProperty(
        name="Object Scale", default=1.0, min=0.01, max=100.0, description="Footage pixels per matte pixel")
    foreground_gain: bpy.props.FloatProperty(
        name="Foreground Gain", default=1.0, min=0.0, max=100.0, description="Factor on the object's own light")
    frame_start: bpy.props.IntProperty(
        name="First Frame", default=1, description="Frame of the scene with the first matte and each movie's first frame")
    directory: bpy.props.StringProperty(
        name="Frames", subtype="DIR_PATH", default="//glasswing/", description="Directory for the scene's frames")

    rays: bpy.props.StringProperty(name="Rays", subtype="FILE_PATH", description="An .exr from glasswing rays")
    camera: bpy.props.PointerProperty(
        type=bpy.types.Object, name="Camera", poll=lambda self, each: each.type == "CAMERA",
        description="Gets the captured camera's lens and the card in front of it; none: a new camera is made")
    unit_mm: bpy.props.FloatProperty(
        name="Unit", default=1000.0, min=1e-3, max=1e6, description="Millimetres per scene unit")
    exact_depth: bpy.props.FloatProperty(
        name="Exact Depth", min=0.0, max=1e7,
        description="Depth at which things behind the object are shown exactly, mm from the camera; 0: far away")
    environment: bpy.props.PointerProperty(
        type=bpy.types.Image, name="Environment", description="An equirectangular picture")
    environment_turn: bpy.props.FloatProperty(
        name="Turn", subtype="ANGLE", description="Turn of the environment: the view ahead of the camera moves to the right")
    environment_gain: bpy.props.FloatProperty(
        name="Gain", default=1.0, min=0.0, max=1e4, description="Factor on the environment's light")


class _Operator(bpy.types.Operator):
    def execute(self, context):
        try:
            self.run(context, context.scene.glasswing)
        except (OSError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class GLASSWING_OT_load(_Operator):
    """Read the matte and list its monitors"""

    bl_idname, bl_label = "glasswing.load", "Load"

    def run(self, context, settings):
        matte, _ = loaded(matte_files(settings.matte)[0])
        before = {each.name: each.image for each in settings.pictures}
        settings.pictures.clear()
        for monitor in matte.monitors:
            each = settings.pictures.add()
            each.name, each.image = monitor.name, before.get(monitor.name)
        for warning in matte.warnings:
            self.report({"WARNING"}, warning)


class GLASSWING_OT_composite(_Operator):
    """Put the pictures behind the object, at the scene's current frame, into the image "Glasswing\""""

    bl_idname, bl_label = "glasswing.composite", "Composite"

    def run(self, context, settings):
        image = pictures.show(_IMAGE, composited(settings, context.scene.frame_current))
        if context.space_data and context.space_data.type == "IMAGE_EDITOR":
            context.space_data.image = image


class GLASSWING_OT_frames(_Operator):
    """Composite every frame of the scene's range into numbered OpenEXR files, and load them as a sequence"""

    bl_idname, bl_label = "glasswing.frames", "Composite Frames"

    def run(self, context, settings):
        scene = context.scene
        directory = bpy.path.abspath(settings.directory)
        os.makedirs(directory, exist_ok=True)
        files = {frame: os.path.join(directory, f"glasswing_{frame:04d}.exr")
                 for frame in range(scene.frame_start, scene.frame_end + 1)}
        context.window_manager.progress_begin(scene.frame_start, scene.frame_end)
        for frame, file in files.items():
            pictures.save(pictures.show(_IMAGE, composited(settings, frame)), file)
            context.window_manager.progress_update(frame)
        context.window_manager.progress_end()
        sequence = bpy.data.images.load(files[scene.frame_start])
        sequence.source = "SEQUENCE"
        sequence.name = f"{_IMAGE} frames"


class GLASSWING_OT_card(_Operator):
    """Put the rays' object into the scene: a card in front of the camera that refracts what is behind it (Cycles)"""

    bl_idname, bl_label, bl_options = "glasswing.card", "Set Into Scene", {"UNDO"}

    def run(self, context, settings):
        path = bpy.path.abspath(settings.rays)
        rays = read_rays(path)
        card = card_of(rays, settings.exact_depth)
        if settings.camera is None:
            settings.camera = scene_3d.new_camera(context.scene)
        scene_3d.set_lens(context.scene, settings.camera, rays.camera, card.corners[..., 2].min() / settings.unit_mm)
        name = os.path.splitext(os.path.basename(path))[0]
        scene_3d.new_card(context.scene, settings.camera, name, card, settings.unit_mm)
        for warning in rays.warnings:
            self.report({"WARNING"}, warning)


class GLASSWING_OT_world(_Operator):
    """Make the environment the scene's world, with its centre ahead of the camera"""

    bl_idname, bl_label, bl_options = "glasswing.world", "Set World", {"UNDO"}

    def run(self, context, settings):
        camera = settings.camera or context.scene.camera
        if camera is None or settings.environment is None:
            raise ValueError("choose an environment, and the camera that faces its centre")
        scene_3d.set_world(
            context.scene, camera, settings.environment, settings.environment_turn, settings.environment_gain)


class GLASSWING_PT_panel(bpy.types.Panel):
    bl_idname, bl_label = "GLASSWING_PT_panel", "Glasswing"
    bl_space_type, bl_region_type, bl_category = "IMAGE_EDITOR", "UI", "Glasswing"

    def draw(self, context):
        settings, layout = context.scene.glasswing, self.layout
        layout.use_property_split = True
        layout.prop(settings, "matte")
        layout.operator("glasswing.load")
        for each in settings.pictures:
            box = layout.box()
            box.label(text=each.name)
            box.template_ID(each, "image", open="image.open")
            if settings.view != "FOOTAGE" or each != settings.pictures[0]:
                box.prop(each, "offset")
                box.prop(each, "scale")
            box.prop(each, "frame_offset")
        layout.prop(settings, "view")
        if settings.view == "FOOTAGE":
            layout.prop(settings, "object_offset")
            layout.prop(settings, "object_scale")
        layout.prop(settings, "foreground_gain")
        layout.prop(settings, "frame_start")
        layout.operator("glasswing.composite")
        layout.prop(settings, "directory")
        layout.operator("glasswing.frames")


class GLASSWING_PT_scene(bpy.types.Panel):
    bl_idname, bl_label = "GLASSWING_PT_scene", "Glasswing"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "Glasswing"

    def draw(self, context):
        settings, layout = context.scene.glasswing, self.layout
        layout.use_property_split = True
        for name in ("rays", "camera", "unit_mm", "exact_depth"):
            layout.prop(settings, name)
        layout.operator("glasswing.card")
        layout.separator()
        layout.template_ID(settings, "environment", open="image.open")
        layout.prop(settings, "environment_turn")
        layout.prop(settings, "environment_gain")
        layout.operator("glasswing.world")


_CLASSES = (
    GlasswingPicture,
    GlasswingSettings,
    GLASSWING_OT_load,
    GLASSWING_OT_composite,
    GLASSWING_OT_frames,
    GLASSWING_OT_card,
    GLASSWING_OT_world,
    GLASSWING_PT_panel,
    GLASSWING_PT_scene,
)


def register():
    for each in _CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.glasswing = bpy.props.PointerProperty(type=GlasswingSettings)


def unregister():
    del bpy.types.Scene.glasswing
    for each in reversed(_CLASSES):
        bpy.utils.unregister_class(each)
