"""The sidebar's panel in the Image Editor, its settings and its operators."""

import os

import bpy

from . import pictures
from .composite import composited, loaded, matte_files

_IMAGE = "Glasswing"


class GlasswingPicture(bpy.types.PropertyGroup):
    """What stands on one monitor; `name` is the monitor's."""

    image: bpy.props.PointerProperty(
        type=bpy.types.Image, name="Picture", description="A still, sequence or movie; stretched over the monitor")
    offset: bpy.props.FloatVectorProperty(name="Offset", size=2, description="Monitor px, right and down")
    scale: bpy.props.FloatProperty(
        name="Scale", default=1.0, min=0.01, max=100.0, description="About the monitor's middle")
    frame_offset: bpy.props.IntProperty(
        name="Frame Offset", description="Frames that a sequence or movie is ahead")


class GlasswingSettings(bpy.types.PropertyGroup):
    matte: bpy.props.StringProperty(
        name="Matte", subtype="FILE_PATH", description="An .exr of glasswing fetch, or a directory of them: a video's")
    pictures: bpy.props.CollectionProperty(type=GlasswingPicture)
    view: bpy.props.EnumProperty(
        name="View",
        items=[
            ("CAMERA", "Camera", "The whole picture that the rig's camera would have taken"),
            ("OBJECT", "Object", "The object alone, premultiplied, to lay over something"),
            ("FOOTAGE", "Over Footage", "The first monitor's picture with the object in it, moved and scaled"),
        ],
    )
    object_offset: bpy.props.FloatVectorProperty(
        name="Object At", size=2, description="Top left corner of the matte's picture in the footage, px right and down")
    object_scale: bpy.props.FloatProperty(
        name="Object Scale", default=1.0, min=0.01, max=100.0, description="Pixels of the footage for each of the matte")
    foreground_gain: bpy.props.FloatProperty(
        name="Foreground Gain", default=1.0, min=0.0, max=100.0, description="Factor on the object's own light")
    frame_start: bpy.props.IntProperty(
        name="First Frame", default=1, description="Frame of the scene with the first matte and each movie's first frame")
    directory: bpy.props.StringProperty(
        name="Frames", subtype="DIR_PATH", default="//glasswing/", description="Directory for the scene's frames")


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


_CLASSES = (
    GlasswingPicture,
    GlasswingSettings,
    GLASSWING_OT_load,
    GLASSWING_OT_composite,
    GLASSWING_OT_frames,
    GLASSWING_PT_panel,
)


def register():
    for each in _CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.glasswing = bpy.props.PointerProperty(type=GlasswingSettings)


def unregister():
    del bpy.types.Scene.glasswing
    for each in reversed(_CLASSES):
        bpy.utils.unregister_class(each)
