"""Run by Blender: installs the add-on from its archive and composites the cases of a JSON file.

    blender -b -P composite_cases.py -- ARCHIVE CASES

A case has the properties of the scene's settings; "pictures" are properties by monitor, an image, or the first of a
sequence, by its file. Its picture, rows from the top, is written as floats of r, g, b, a to "output"; what fails, as
text to "error".
"""

import json
import pathlib
import sys

import bpy
import numpy as np

archive, cases = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.preferences.addon_install(filepath=archive)
bpy.ops.preferences.addon_enable(module="glasswing_blender")
scene = bpy.context.scene


def set_all(to, values):
    for name, value in values.items():
        if name == "sequence":
            to.image = bpy.data.images.load(value)
            to.image.source = "SEQUENCE"
        else:
            setattr(to, name, bpy.data.images.load(value) if name == "image" else value)


def composite(case):
    settings = scene.glasswing
    for name in settings.bl_rna.properties.keys():
        settings.property_unset(name)
    set_all(settings, case["settings"])
    bpy.ops.glasswing.load()
    for monitor, values in case["pictures"].items():
        set_all(settings.pictures[monitor], values)
    if "frames" in case:
        scene.frame_start, scene.frame_end = case["frames"]
        bpy.ops.glasswing.frames()
        return
    bpy.ops.glasswing.composite()
    image = bpy.data.images["Glasswing"]
    width, height = image.size
    np.array(image.pixels[:], np.float32).reshape(height, width, 4)[::-1].tofile(case["output"])


for case in json.loads(pathlib.Path(cases).read_text()):
    try:
        composite(case)
    except RuntimeError as error:  # what an operator reports
        pathlib.Path(case["error"]).write_text(str(error))
bpy.ops.preferences.addon_disable(module="glasswing_blender")
