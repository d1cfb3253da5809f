"""Cards of rays in Blender's scene: camera, facets, the material that redirects light, and the world's environment."""

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector

_FROM_CAMERA = np.array([1.0, -1.0, -1.0])  # Blender's cameras look along -Z, y up
_MATERIAL, _WORLD = "Glasswing rays", "Glasswing environment"
_CARD = "glasswing_card"  # a property of its object: its name
_FACET_VECTORS = ("target", "target_u", "target_v", "weight", "through", "light")
_IOR = 0.05  # facets are tilted by less than 3 degrees, and Cycles does not modify such normals
_MAX_TURN = 1.5  # rad, of a bundle's parts about its middle


def new_camera(scene):
    """A level camera at the world's origin that looks along +Y; becomes the scene's, if it has none."""
    camera = bpy.data.objects.new("Glasswing camera", bpy.data.cameras.new("Glasswing camera"))
    camera.rotation_euler = (math.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = scene.camera or camera
    bpy.context.view_layer.update()
    return camera


def set_lens(scene, camera, of, nearest):
    """The captured camera without its distortion, and the render's size. `nearest`: distance of the nearest thing it must
    see, in the scene's units."""
    lens = camera.data
    lens.type, lens.sensor_fit, lens.sensor_width = "PERSP", "HORIZONTAL", 36.0
    lens.lens = of.fx * lens.sensor_width / of.width
    lens.shift_x, lens.shift_y = 0.5 - of.cx / of.width, (of.cy - 0.5 * of.height) / of.width
    lens.clip_start = min(lens.clip_start, 0.5 * nearest)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = of.width, of.height, 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1


def new_card(scene, camera, name, card, unit_mm):
    """The card as an object in front of the camera, replacing one of that name; `unit_mm`: size of the scene's unit."""
    for before in [each for each in camera.children if each.get(_CARD) == name]:
        bpy.data.meshes.remove(before.data)  # and the object with it
    count = len(card.corners)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(4 * count)
    mesh.vertices.foreach_set("co", (card.corners * _FROM_CAMERA / unit_mm).astype(np.float32).ravel())
    mesh.loops.add(4 * count)
    mesh.loops.foreach_set("vertex_index", np.arange(4 * count, dtype=np.int32))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * count, 4, dtype=np.int32))
    mesh.polygons.foreach_set("loop_total", np.full(count, 4, np.int32))
    mesh.update(calc_edges=True)
    points = np.where(card.finite[:, None] > 0, _FROM_CAMERA / unit_mm, _FROM_CAMERA)
    values = {name: getattr(card, name) for name in _FACET_VECTORS}
    values.update({name: values[name] * points for name in ("target", "target_u", "target_v")})
    for each in _FACET_VECTORS:
        facets = mesh.attributes.new(f"glasswing_{each}", "FLOAT_VECTOR", "FACE")
        facets.data.foreach_set("vector", values[each].astype(np.float32).ravel())
    mesh.attributes.new("glasswing_finite", "FLOAT", "FACE").data.foreach_set("value", card.finite.astype(np.float32))
    mesh.materials.append(_material())
    made = bpy.data.objects.new(name, mesh)
    made[_CARD] = name
    for way in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(made, f"visible_{way}", False)
    made.parent = camera
    scene.collection.objects.link(made)
    # A pixel's facets are passed one by one.
    scene.cycles.transparent_max_bounces = max(scene.cycles.transparent_max_bounces, card.max_facets + 8)
    return made


class _Nodes:
    def __init__(self, tree):
        self.tree = tree
        tree.nodes.clear()

    def add(self, kind, *inputs, **properties):
        node = self.tree.nodes.new(kind)
        for name, value in properties.items():
            setattr(node, name, value)
        for socket, value in zip(node.inputs, inputs):
            self.put(socket, value)
        return node

    def put(self, socket, value):
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        elif value is not None:
            socket.default_value = value

    def number(self, operation, *inputs):
        return self.add("ShaderNodeMath", *inputs, operation=operation).outputs[0]

    def vector(self, operation, *inputs):
        if operation == "SCALE":
            inputs = (inputs[0], None, None, inputs[1])
        node = self.add("ShaderNodeVectorMath", *inputs, operation=operation)
        return node.outputs["Value" if operation in ("LENGTH", "DOT_PRODUCT") else "Vector"]

    def facet(self, name):
        return self.add("ShaderNodeAttribute", attribute_name=f"glasswing_{name}").outputs

    def in_world(self, vector):
        node = self.add("ShaderNodeVectorTransform", vector, vector_type="VECTOR", convert_from="OBJECT", convert_to="WORLD")
        return node.outputs[0]


def _material():
    """Redirects each sample's ray along one line of its facet's bundle."""
    material = bpy.data.materials.get(_MATERIAL)
    if material is not None:
        return material
    material = bpy.data.materials.new(_MATERIAL)
    material.use_nodes = True
    material.cycles.sample_as_light = False
    n = _Nodes(material.node_tree)
    to_camera = n.add("ShaderNodeNewGeometry").outputs["Incoming"]
    towards = _towards(n)

    # Light from index n to 1 continues along d if the normal is along (to the camera) + n d: Snell's law with vectors.
    normal = n.vector("NORMALIZE", n.vector("ADD", n.vector("SCALE", towards, _IOR), to_camera))
    weight = n.facet("weight")["Vector"]
    refracted = n.add("ShaderNodeBsdfRefraction", distribution="SHARP")
    mirrored = n.add("ShaderNodeBsdfGlossy", distribution="SHARP")
    half = n.vector("NORMALIZE", n.vector("ADD", towards, to_camera))
    for node, at in ((refracted, normal), (mirrored, half)):
        n.put(node.inputs["Color"], weight)
        n.put(node.inputs["Normal"], at)
    n.put(refracted.inputs["IOR"], _IOR)
    back = n.number("GREATER_THAN", n.vector("DOT_PRODUCT", towards, to_camera), 0.0)
    bent = n.add("ShaderNodeMixShader", back, refracted.outputs[0], mirrored.outputs[0])
    through = n.add("ShaderNodeBsdfTransparent", n.facet("through")["Vector"])
    light = n.add("ShaderNodeEmission", n.facet("light")["Vector"], 1.0)
    total = n.add("ShaderNodeAddShader", bent.outputs[0], through.outputs[0])
    total = n.add("ShaderNodeAddShader", total.outputs[0], light.outputs[0])
    n.add("ShaderNodeOutputMaterial", total.outputs[0])
    return material


def _towards(n):
    """The direction in the world, a unit, of a line of the bundle, drawn at random from this sample's position."""
    place = n.add("ShaderNodeTexCoord").outputs["Object"]
    noise = n.add("ShaderNodeTexWhiteNoise", place, noise_dimensions="3D").outputs["Color"]
    drawn = n.add("ShaderNodeSeparateXYZ", noise).outputs
    length = n.number("SQRT", n.number("MULTIPLY", n.number("LOGARITHM", drawn[0], math.e), -2.0))
    angle = n.number("MULTIPLY", drawn[1], 2 * math.pi)
    u = n.number("MULTIPLY", length, n.number("COSINE", angle))
    v = n.number("MULTIPLY", length, n.number("SINE", angle))
    finite = n.facet("finite")["Fac"]
    moved = n.vector("ADD", n.vector("SCALE", n.facet("target_u")["Vector"], u),
                     n.vector("SCALE", n.facet("target_v")["Vector"], v))
    # Spreads of directions are angles.
    size = n.vector("LENGTH", moved)
    tangent = n.number("DIVIDE", n.number("TANGENT", n.number("MINIMUM", size, _MAX_TURN)), n.number("MAXIMUM", size, 1e-6))
    stretch = n.number("MAXIMUM", n.number("MULTIPLY", tangent, n.number("SUBTRACT", 1.0, finite)), finite)
    target = n.vector("ADD", n.facet("target")["Vector"], n.vector("SCALE", moved, stretch))
    return n.vector("NORMALIZE", n.in_world(n.vector("SUBTRACT", target, n.vector("SCALE", place, finite))))


def set_world(scene, camera, image, turn, gain):
    """The environment as in glasswing composite: the picture's centre ahead of the camera, then turned to the right."""
    world = scene.world = bpy.data.worlds.get(_WORLD) or bpy.data.worlds.new(_WORLD)
    world.use_nodes = True
    n = _Nodes(world.node_tree)
    turned = Matrix.Rotation(-turn, 3, "Y")  # the camera's y is up
    ahead, left, up = (camera.matrix_world.to_3x3() @ turned @ Vector(axis) for axis in ((0, 0, -1), (-1, 0, 0), (0, 1, 0)))
    # Blender's map has its centre along +X, and its left half along +Y.
    mapping = n.add("ShaderNodeMapping", n.add("ShaderNodeTexCoord").outputs["Generated"])
    mapping.inputs["Rotation"].default_value = Matrix((ahead, left, up)).normalized().to_euler()
    picture = n.add("ShaderNodeTexEnvironment", mapping.outputs[0], image=image)
    n.add("ShaderNodeOutputWorld", n.add("ShaderNodeBackground", picture.outputs["Color"], gain).outputs[0])
