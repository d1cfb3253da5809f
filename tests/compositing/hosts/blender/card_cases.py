"""Run by Blender: installs the add-on from its archive, sets the rays of a JSON file's cases into scenes, and renders them.

    blender -b -P card_cases.py -- ARCHIVE CASES

A case has the scene's settings, "samples" a pixel, and what stands behind: "planes", parallel to the nearest monitor and as
large, of "depth" (mm) and "picture"; an "environment". A "camera" that the scene has, its "location" and "rotation", takes the
card; planes are placed for the add-on's own. The render, "finer" times as large, is written to "output": rows from the top,
floats of r, g, b. What fails is written as text to "error".
"""

import json
import pathlib
import sys

import bpy
import numpy as np

archive, cases = sys.argv[sys.argv.index("--") + 1 :]
bpy.ops.preferences.addon_install(filepath=archive)
bpy.ops.preferences.addon_enable(module="glasswing_blender")
from glasswing_blender import exr  # noqa: E402


def empty_scene():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.preferences.addon_enable(module="glasswing_blender")
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("black")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.pixel_filter_type, cycles.sample_clamp_indirect = "BOX", 0
    return scene


def add_plane(scene, pose, depth, file, unit_mm):
    """In the frame of a camera at the origin that looks along +Y."""
    rotation = np.reshape(pose["rotation"], (3, 3))
    corner = np.array(pose["translation_mm"], float)
    corner += (depth - rotation[:, 2] @ corner) * rotation[:, 2]
    width, height = pose["width_px"] * pose["pitch_mm"], pose["height_px"] * pose["pitch_mm"]
    points = [corner + rotation[:, 0] * x + rotation[:, 1] * y for x, y in ((0, height), (width, height), (width, 0), (0, 0))]
    mesh = bpy.data.meshes.new("plane")
    mesh.from_pydata([(p[0] / unit_mm, p[2] / unit_mm, -p[1] / unit_mm) for p in points], [], [(0, 1, 2, 3)])
    mesh.uv_layers.new().data.foreach_set("uv", (0, 0, 1, 0, 1, 1, 0, 1))
    material = bpy.data.materials.new("plane")
    material.use_nodes = True
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    nodes.clear()
    picture, light, end = (nodes.new(f"ShaderNode{kind}") for kind in ("TexImage", "Emission", "OutputMaterial"))
    picture.image, picture.interpolation = bpy.data.images.load(file), "Closest"
    link(picture.outputs["Color"], light.inputs["Color"])
    link(light.outputs[0], end.inputs["Surface"])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("plane", mesh))


def render(case):
    scene = empty_scene()
    settings = scene.glasswing
    for name, value in case["settings"].items():
        setattr(settings, name, value)
    if "camera" in case:
        settings.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        settings.camera.location, settings.camera.rotation_euler = case["camera"]["location"], case["camera"]["rotation"]
        scene.collection.objects.link(settings.camera)
        scene.camera = settings.camera
        bpy.context.view_layer.update()
    bpy.ops.glasswing.card()
    bpy.ops.glasswing.card()  # in place of the first
    if "environment" in case:
        settings.environment = bpy.data.images.load(case["environment"])
        bpy.ops.glasswing.world()
        # Our pixels are flat.
        scene.world.node_tree.nodes["Environment Texture"].interpolation = "Closest"
    [(part, _), *_] = exr.read_parts(settings.rays, lambda name: False)
    pose = json.loads(part.text["glasswing:rays"])["geometry"]["monitors"][0]
    for plane in case.get("planes", ()):
        add_plane(scene, pose, plane["depth"], plane["picture"], settings.unit_mm)
    scene.cycles.samples = case["samples"]
    scene.render.resolution_percentage = 100 * case.get("finer", 1)
    scene.render.filepath = case["output"] + ".exr"
    bpy.ops.render.render(write_still=True)
    [(_, planes)] = exr.read_parts(scene.render.filepath)
    np.stack([planes[colour] for colour in "RGB"], -1).tofile(case["output"])


for case in json.loads(pathlib.Path(cases).read_text()):
    try:
        render(case)
    except RuntimeError as error:  # what an operator reports
        pathlib.Path(case["error"]).write_text(str(error))
