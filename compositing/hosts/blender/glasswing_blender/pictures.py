"""Light from Blender's images, and images from light. Arrays are (height, width, channels), the first row on top."""

import contextlib
import os
import pathlib
import re
import tempfile

import bpy
import numpy as np

from . import exr


def light_of(image, frame):
    """(height, width, 3) scene-linear light of an image; for a sequence or movie its frame `frame`, from 0 on, repeating."""
    if image.source != "SEQUENCE":
        return _rendered(image, frame)
    files = _files_of(image)
    still = bpy.data.images.load(str(files[frame % len(files)]))
    try:
        still.colorspace_settings.name = image.colorspace_settings.name
        return _rendered(still, 0)
    finally:
        bpy.data.images.remove(still)


def _files_of(sequence):
    """Blender itself stores the first name and a pattern: names that differ only in their last number."""
    path = pathlib.Path(bpy.path.abspath(sequence.filepath))
    before, number, after = re.fullmatch(r"(.*?)(\d*)(\D*)", path.name).groups()
    numbered = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
    found = {file: int(match[1]) for file in path.parent.iterdir() if (match := numbered.fullmatch(file.name))}
    if not number or not found:
        raise ValueError(f"{path} does not belong to a sequence of numbered files")
    return sorted(found, key=found.get)


def _rendered(image, frame):
    """Through a one-node compositor, which supports every format, color space and movie."""
    width, height = image.size
    if not width or not height:
        raise ValueError(f"{image.name} cannot be read: {image.filepath or image.source}")
    with _exr_scene() as scene, tempfile.TemporaryDirectory() as directory:
        scene.use_nodes = True
        nodes = scene.node_tree.nodes
        nodes.clear()
        source, end = nodes.new("CompositorNodeImage"), nodes.new("CompositorNodeComposite")
        source.image = image
        if image.source == "MOVIE":
            source.frame_start, source.frame_duration = 1, max(image.frame_duration, 1)
            source.frame_offset = frame % source.frame_duration
        scene.node_tree.links.new(source.outputs["Image"], end.inputs["Image"])
        scene.frame_set(1)
        render = scene.render
        render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
        render.use_sequencer = False
        render.filepath = os.path.join(directory, "picture.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
        [(_, planes)] = exr.read_parts(render.filepath)
    return np.stack([planes[colour] for colour in "RGB"], -1)


@contextlib.contextmanager
def _exr_scene():
    """A scene that writes pictures as 32-bit float OpenEXR."""
    scene = bpy.data.scenes.new("Glasswing picture")
    try:
        settings = scene.render.image_settings
        settings.file_format, settings.color_mode, settings.color_depth, settings.exr_codec = "OPEN_EXR", "RGBA", "32", "ZIP"
        yield scene
    finally:
        bpy.data.scenes.remove(scene)


def show(name, picture):
    """The image `name`, linear floats, of a premultiplied picture with alpha."""
    height, width, _ = picture.shape
    image = bpy.data.images.get(name)
    if image is None or not image.is_float or image.source != "GENERATED":
        image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True)
        image.alpha_mode = "PREMUL"
    if tuple(image.size) != (width, height):
        image.scale(width, height)
    image.pixels.foreach_set(picture[::-1].astype(np.float32).ravel())
    image.update()
    return image


def save(image, path):
    # Not with image.save(), which applies the sRGB curve to floats (3.4.1).
    with _exr_scene() as scene:
        image.save_render(path, scene=scene)
