#!/usr/bin/python3
"""What Nuke would make of a script, by what the Foundry's Reference Guide says of the nodes in it.

    nuke_graph.py SCRIPT OUTPUT [NAME=PICTURE.exr ...] [--expected PICTURE.exr]

plugs pictures into the inputs of the script's group, by name, and writes what leaves the group as floats of r, g, b,
a, rows from the top. It shares no code with the writer of scripts, and refuses what it does not know. Figures of
docs/hosts.md are those of --expected, in linear light, both clipped to 0..1.

Of the nodes:
  stack       a node takes its inputs from a stack, the first on top; `push 0` is none
  Read        a file's channel a.b.R is layer a_b, channel red (the NDK's example ExrChannelNameToNuke)
  coordinates count from the bottom left corner; pixels' middles are at .5
  Impulse     "the exact value of the square pixel that x, y lands in" (nuke.sample)
  STMap       input 0 is the source, 1 the map; 0 is the bottom left corner of the source, 1 the top right one;
              the result is as large as the map
  Merge2, MergeExpression, Copy   input 0 is B, whose other channels and size pass through; 1 is A
  average     (A + B) / 2;  plus: A + B
  Expression  values for red, green, blue and alpha; numbers are 32-bit floats
Nothing lies beyond a picture's frame.
"""

import argparse
import ast
import collections
import pathlib
import re
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "client" / "python"))
import exr_reader  # noqa: E402

RGBA = ("rgba.red", "rgba.green", "rgba.blue", "rgba.alpha")
SHORT = dict(zip("rgba", RGBA))


def words_of(text):
    """Commands of Tcl, as lists of words; words in braces or quotes are whole."""
    at, commands, words = 0, [], []
    while at < len(text):
        c = text[at]
        if c == "#" and not words:
            at = (text + "\n").index("\n", at)
        elif c in "\n;":
            if words:
                commands.append(words)
            words, at = [], at + 1
        elif c in " \t":
            at += 1
        elif c == "{":
            depth, end = 1, at + 1
            while depth:
                depth += {"{": 1, "}": -1}.get(text[end], 0)
                end += 1
            words.append(text[at + 1 : end - 1])
            at = end
        elif c == '"':
            end = text.index('"', at + 1)
            words.append(text[at + 1 : end])
            at = end + 1
        else:
            end = re.compile(r"\[[^]]*\]|[^\s;{]+").match(text, at).end()
            words.append(text[at:end])
            at = end
    return commands + ([words] if words else [])


class Node:
    def __init__(self, kind, knobs, inputs):
        self.kind, self.knobs, self.inputs, self.users, self.members = kind, knobs, inputs, 0, []
        for node in inputs:
            if node:
                node.users += 1


def nodes_of(text):
    """All nodes outside groups; a group has those within it as `members`."""
    stack, names, roots, layers = [], {}, [], {"rgba"}
    groups, outer = [roots], []
    for words in words_of(text):
        match words:
            case ["set", name, "[stack 0]"]:
                names[name] = stack[-1]
            case ["push", "0"]:
                stack.append(None)
            case ["push", name]:
                stack.append(names[name.removeprefix("$")])
            case ["add_layer", channels]:
                layers.add(channels.split()[0])
            case ["end_group"]:
                groups.pop()
                stack, names = outer.pop()
            case [kind, body] if kind[0].isupper():
                knobs = {name: " ".join(value) for name, *value in words_of(body)}
                inputs = [stack.pop() for _ in range(int(knobs.get("inputs", 1)))]
                node = Node(kind, knobs, inputs)
                node.layers = layers
                stack.append(node)
                groups[-1].append(node)
                if kind == "Group":
                    outer.append((stack, names))
                    stack, names = [], {}
                    groups.append(node.members)
            case _:
                raise ValueError(f"not known: {' '.join(words)[:80]}")
    return roots


class Picture:
    """Channels by name, rows from the bottom."""

    def __init__(self, channels):
        self.channels = channels
        self.height, self.width = next(iter(channels.values())).shape


def nuke_channel(name):
    *layer, channel = name.split(".")
    channel = {"R": "red", "G": "green", "B": "blue", "A": "alpha"}.get(channel, channel)
    return f"{'_'.join(layer) or 'rgba'}.{channel}"


def read(path):
    channels = {}
    for part, planes in exr_reader.read_exr(pathlib.Path(path)).items():
        for name, plane in planes.items():
            whole = name if part in ("", "preview") else f"{part}.{name}"
            channels[nuke_channel(whole)] = np.ascontiguousarray(plane[::-1], np.float32)
    return Picture(channels)


FUNCTIONS = {
    "max": np.maximum,
    "min": np.minimum,
    "hypot": np.hypot,
    "atan2": np.arctan2,
    "sqrt": np.sqrt,
    "cos": np.cos,
    "sin": np.sin,
    "abs": np.abs,
    "fmod": np.fmod,
    "trunc": np.trunc,
    "clamp": lambda value: np.clip(value, np.float32(0), np.float32(1)),
}
OPERATORS = {ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide}


def calculate(tree, channel, variables):
    """`channel` gives a channel's plane by its name."""
    match tree:
        case ast.Expression(body=body):
            return calculate(body, channel, variables)
        case ast.Constant(value=value):
            return np.float32(value)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -calculate(operand, channel, variables)
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATORS[type(op)](calculate(left, channel, variables), calculate(right, channel, variables))
        case ast.Compare(left=left, ops=[ast.Lt()], comparators=[right]):
            return (calculate(left, channel, variables) < calculate(right, channel, variables)).astype(np.float32)
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return FUNCTIONS[name](*(calculate(each, channel, variables) for each in arguments))
        case ast.Attribute(value=ast.Name(id=layer), attr=name):
            return channel(f"{layer}.{name}")
        case ast.Name(id=name) if name in variables:
            return variables[name]
        case ast.Name(id=name):
            return channel(name)
    raise ValueError(f"not known: {ast.dump(tree)}")


class Evaluation:
    def __init__(self, group, plugged):
        """`plugged`: pictures by input, in the group's order."""
        self.plugged, self.files, self.kept = plugged, {}, {}
        self.recent = collections.OrderedDict()  # long chains need a few planes only
        self.inputs = {}
        for node in group.members:
            if node.kind == "Input":
                self.inputs[node] = plugged[int(node.knobs.get("number", 0))]
        (self.output,) = (node for node in group.members if node.kind == "Output")

    def size(self, node):
        """Width and height."""
        match node.kind:
            case "Input":
                return self.inputs[node].width, self.inputs[node].height
            case "Reformat":
                assert node.knobs["type"] == "to box" and node.knobs["box_fixed"] == "true"
                return int(node.knobs["box_width"]), int(node.knobs["box_height"])
            case "STMap":
                return self.size(node.inputs[1])
        return self.size(node.inputs[0])

    def plane(self, node, channel):
        key = (node, channel)
        if key in self.kept:
            return self.kept[key]
        if key in self.recent:
            return self.recent[key]
        plane = self.calculated(node, channel)
        assert plane.dtype == np.float32 and plane.shape == self.size(node)[::-1], (node.kind, node.knobs["name"])
        if node.users > 2:
            self.kept[key] = plane
        else:
            self.recent[key] = plane
            if len(self.recent) > 6:
                self.recent.popitem(last=False)
        return plane

    def black(self, node):
        width, height = self.size(node)
        return np.zeros((height, width), np.float32)

    def calculated(self, node, channel):
        if not channel.startswith("rgba.") and channel.split(".")[0] not in node.layers and "gw" == channel[:2]:
            raise ValueError(f"no layer has the channel {channel}")
        return getattr(self, node.kind.lower())(node, channel)

    def input(self, node, channel):
        found = self.inputs[node].channels.get(channel)
        if found is None and node.knobs["name"] == "matte":
            raise ValueError(f"the file has no channel {channel}")
        return self.black(node) if found is None else found

    def remove(self, node, channel):
        assert node.knobs["operation"] == "keep" and node.knobs["channels"] == "rgb"
        return self.plane(node.inputs[0], channel) if channel in RGBA[:3] else self.black(node)

    def crop(self, node, channel):
        left, bottom, right, top = map(int, node.knobs["box"].split())
        plane = self.black(node)
        plane[bottom:top, left:right] = self.plane(node.inputs[0], channel)[bottom:top, left:right]
        return plane

    def reformat(self, node, channel):
        source = self.plane(node.inputs[0], channel)
        width, height = self.size(node)
        if node.knobs["resize"] == "none":
            assert node.knobs["center"] == "false"
            plane = self.black(node)
            plane[: source.shape[0], : source.shape[1]] = source[:height, :width]
            return plane
        assert node.knobs["resize"] == "distort"
        if source.shape == (height, width):
            return source
        assert node.knobs["filter"] == "Impulse", "pictures must be as large as their monitor"
        rows = np.floor((np.arange(height) + 0.5) * source.shape[0] / height).astype(int)
        columns = np.floor((np.arange(width) + 0.5) * source.shape[1] / width).astype(int)
        return source[rows[:, None], columns[None, :]]

    def transform(self, node, channel):
        assert node.knobs["center"] == "0 0" and node.knobs["filter"] == "Impulse"
        x, y = map(int, node.knobs["translate"].split())
        source, plane = self.plane(node.inputs[0], channel), self.black(node)
        height, width = plane.shape
        to = (slice(max(y, 0), height + min(y, 0)), slice(max(x, 0), width + min(x, 0)))
        plane[to] = source[max(-y, 0) : height - max(y, 0), max(-x, 0) : width - max(x, 0)]
        return plane

    def merge2(self, node, channel):
        b = self.plane(node.inputs[0], channel)
        if channel not in RGBA:
            return b
        a = self.plane(node.inputs[1], channel)
        match node.knobs["operation"]:
            case "average":
                return (a + b) / np.float32(2)
            case "plus":
                return a + b
        raise ValueError(f"operation {node.knobs['operation']}")

    def copy(self, node, channel):
        for i in range(4):
            if node.knobs.get(f"to{i}") == channel:
                return self.plane(node.inputs[1], node.knobs[f"from{i}"])
        return self.plane(node.inputs[0], channel)

    def stmap(self, node, channel):
        assert node.knobs["channels"] == "all" and node.knobs["uv"] == "rgb" and node.knobs["filter"] == "Impulse"
        source = self.plane(node.inputs[0], channel)
        height, width = source.shape
        x = np.floor(self.plane(node.inputs[1], RGBA[0]) * np.float32(width)).astype(int)
        y = np.floor(self.plane(node.inputs[1], RGBA[1]) * np.float32(height)).astype(int)
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        return np.where(inside, source[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)], np.float32(0))

    def evaluated(self, node, channel, look_up):
        if channel not in RGBA:
            return self.plane(node.inputs[0], channel)
        text = node.knobs[f"expr{RGBA.index(channel)}"]
        variables = {}
        for i in range(4):
            if f"temp_name{i}" in node.knobs and re.search(rf"\b{node.knobs[f'temp_name{i}']}\b", text):
                tree = ast.parse(node.knobs[f"temp_expr{i}"], mode="eval")
                variables[node.knobs[f"temp_name{i}"]] = calculate(tree, look_up, {})
        plane = np.asarray(calculate(ast.parse(text, mode="eval"), look_up, variables), np.float32)
        return plane if plane.ndim else np.full(self.size(node)[::-1], plane)

    def expression(self, node, channel):
        return self.evaluated(node, channel, lambda name: self.plane(node.inputs[0], SHORT.get(name, name)))

    def mergeexpression(self, node, channel):
        def look_up(name):
            side, rest = {"A": 1, "B": 0}[name[0]], name[1:]
            return self.plane(node.inputs[side], SHORT.get(rest, rest))

        return self.evaluated(node, channel, look_up)

    def colormatrix(self, node, channel):
        if channel not in RGBA[:3]:
            return self.plane(node.inputs[0], channel)
        (rows,) = (words for words in words_of(node.knobs["matrix"].replace("\n", " ")))
        row = [np.float32(value) for value in rows[RGBA.index(channel)].split()]
        planes = [self.plane(node.inputs[0], each) for each in RGBA[:3]]
        return row[0] * planes[0] + row[1] * planes[1] + row[2] * planes[2]

    def result(self):
        """Height x width x 4, rows from the top."""
        planes = []
        for channel in RGBA:
            planes.append(self.plane(self.output.inputs[0], channel)[::-1])
            self.kept.clear()
            self.recent.clear()
        return np.stack(planes, -1)


def evaluate(script, pictures):
    sys.setrecursionlimit(100000)
    roots = nodes_of(pathlib.Path(script).read_text())
    (group,) = (node for node in roots if node.kind == "Group")
    names = {
        int(node.knobs.get("number", 0)): node.knobs["name"] for node in group.members if node.kind == "Input"
    }
    plugged = []
    for number, source in enumerate(group.inputs):
        if source:
            assert source.kind == "Read" and source.knobs["raw"] == "true"
            plugged.append(read(source.knobs["file"]))
        else:
            assert names[number] in pictures, f"no picture for {names[number]}"
            plugged.append(read(pictures[names[number]]))
    return Evaluation(group, plugged).result()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("script")
    parser.add_argument("output")
    parser.add_argument("pictures", nargs="*", help="NAME=FILE")
    parser.add_argument("--expected")
    arguments = parser.parse_args()
    result = evaluate(arguments.script, dict(each.split("=", 1) for each in arguments.pictures))
    result.tofile(arguments.output)
    if arguments.expected:
        channels = read(arguments.expected).channels
        expected = np.stack([channels[name][::-1] for name in RGBA[:3]], -1)
        error = np.clip(result[..., :3], 0, 1).astype(float) - np.clip(expected, 0, 1)
        print(f"PSNR {-10 * np.log10((error * error).mean()):.1f} dB, largest difference {np.abs(error).max():.3f}")


if __name__ == "__main__":
    main()
