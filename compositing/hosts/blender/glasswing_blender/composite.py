"""Composites of the scene's settings; no user interface."""

import os
import pathlib

import bpy
import numpy as np

from . import pictures
from .compositor import Compositor
from .matte import read_matte
from .placement import chained, inverse, stretched, warped

_kept = {}  # the newest matte: (path, time of writing): (Matte, Compositor)


def matte_files(path):
    """The mattes of a file, or of a video's directory, in order."""
    path = pathlib.Path(bpy.path.abspath(path))
    if not path.is_dir():
        return [path]
    found = sorted(path.glob("*.exr"), key=lambda file: (len(file.name), file.name))
    if not found:
        raise ValueError(f"{path} contains no .exr files")
    return found


def loaded(path):
    key = (path, os.stat(path).st_mtime_ns)
    if key not in _kept:
        _kept.clear()
        matte = read_matte(path)
        _kept[key] = matte, Compositor(matte)
    return _kept[key]


def composited(settings, frame):
    """(height, width, 4) light and alpha, premultiplied, at a frame of the scene; raises ValueError and OSError."""
    index = frame - settings.frame_start
    files = matte_files(settings.matte)
    matte, compositor = loaded(files[index % len(files)])
    if [each.name for each in settings.pictures] != [monitor.name for monitor in matte.monitors]:
        raise ValueError("the matte has different monitors; load it first")
    lights = [each.image and pictures.light_of(each.image, index + each.frame_offset) for each in settings.pictures]
    behind = [None if light is None else stretched(light, monitor, each.scale, *each.offset)
              for each, light, monitor in zip(settings.pictures, lights, matte.monitors)]
    if settings.view == "FOOTAGE":
        if lights[0] is None:
            raise ValueError("over footage, the first monitor needs a picture")
        if matte.monitor_from_camera is None:
            raise ValueError("the matte shows too little of the first monitor beside the object to locate it")
        scale, (x, y) = settings.object_scale, settings.object_offset
        footage_from_camera = np.array([[scale, 0, x], [0, scale, y]])
        footage_from_monitor = chained(footage_from_camera, inverse(matte.monitor_from_camera))
        behind[0] = warped(lights[0], footage_from_monitor, matte.monitors[0].width, matte.monitors[0].height)
    light = compositor.composite(behind, settings.foreground_gain)
    if settings.view == "CAMERA":
        return np.dstack([light, np.ones_like(matte.coverage)])
    layer = np.dstack([light * matte.coverage[..., None], matte.coverage])
    return layer if settings.view == "OBJECT" else _laid_over(lights[0], layer, footage_from_camera)


def _laid_over(footage, layer, footage_from_camera):
    """The footage with a premultiplied layer over it."""
    height, width = footage.shape[:2]
    out = np.dstack([footage, np.ones((height, width), np.float32)])
    first, end = footage_from_camera @ (0, 0, 1), footage_from_camera @ (layer.shape[1], layer.shape[0], 1)
    left, top = np.maximum(np.floor(first), 0).astype(int)
    right, bottom = np.minimum(np.ceil(end), (width, height)).astype(int)
    if left < right and top < bottom:
        layer_from_part = inverse(footage_from_camera)
        layer_from_part[:, 2] += layer_from_part[:, :2] @ (left, top) + 1  # of the layer with a border of nothing
        over = warped(np.pad(layer, ((1, 1), (1, 1), (0, 0))), layer_from_part, right - left, bottom - top)
        part = out[top:bottom, left:right]
        part *= 1 - over[..., 3:]
        part += over
    return out
