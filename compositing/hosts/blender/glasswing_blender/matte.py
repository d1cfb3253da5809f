"""A matte as arrays (docs/matte.md)."""

import functools
import json
import re
from dataclasses import dataclass, field

import numpy as np

from . import exr

_LAYERS = ("weight", "x", "y", "xx", "xy", "yy", "texture")


@dataclass
class Monitor:
    name: str
    width: int
    height: int


@dataclass
class Matte:
    """Of (height, width) pixels. A mode has arrays of (height, width, 3), by name; px of its monitor."""

    foreground: np.ndarray
    coverage: np.ndarray  # 1 inside the object, 0 outside
    flags: np.ndarray
    modes: list[dict[str, np.ndarray]]
    monitors: list[Monitor]
    is_box: bool
    # By monitor the matrix from its primaries to the camera's channels, and its inverse; None: they are the same.
    crosstalk: tuple[list[np.ndarray], np.ndarray] | None = None
    warnings: list[str] = field(default_factory=list)
    # Footprints of any shape (docs/footprints.md), as Gaussians in place of modes: arrays by name, as those of modes, and
    # "out": 3 * pixel + channel.
    more: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def height(self):
        return self.coverage.shape[0]

    @property
    def width(self):
        return self.coverage.shape[1]

    @functools.cached_property
    def monitor_from_camera(self):
        """The affine map of camera px to the first monitor's, (2, 3), from what is seen beside the object. None: too
        little."""
        seen = (self.coverage == 0) & (self.flags == 0)
        camera, monitor = [], []
        for mode in self.modes:
            green = {name: mode[name][..., 1] for name in ("weight", "x", "y", "texture")}
            rows, columns = np.nonzero(seen & (green["weight"] > 0) & (green["texture"] == 0))
            root = np.sqrt(green["weight"][rows, columns])[:, None]
            camera.append(root * np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))], -1))
            monitor.append(root * np.stack([green["x"][rows, columns], green["y"][rows, columns]], -1))
        camera, monitor = np.concatenate(camera), np.concatenate(monitor)
        if len(camera) < 16:
            return None
        affine, _, rank, _ = np.linalg.lstsq(camera, monitor, rcond=None)
        return affine.T if rank == 3 else None


def read_matte(path):
    """Raises OSError, or ValueError that says what is wrong with the file."""
    pyramids = {}
    parts = exr.read_parts(path, lambda name: name == "foreground" or re.fullmatch(r"mode\d+", name),
                           {"pyramid": lambda row, numbers: pyramids.update({row: numbers[: _end(numbers)].copy()})})
    if "glasswing:rays" in parts[0][0].text:
        raise ValueError(f"{path} contains rays, which the 3D Viewport's panel puts into a scene; this needs a matte")
    text = parts[0][0].text.get("glasswing")
    if text is None:
        raise ValueError(f"{path} is not a matte: its header has no attribute \"glasswing\"")
    metadata = json.loads(text)
    if metadata.get("format_version") != 1:
        raise ValueError(f"{path} has format {metadata.get('format_version')}; this add-on reads 1")
    if metadata.get("footprint", "gaussian") not in ("", "gaussian", "box", "pyramid"):
        raise ValueError(f"{path} has footprints of the kind \"{metadata['footprint']}\"; gaussian, box and pyramid are supported")
    planes = {part.name: _whole(part, of, metadata) for part, of in parts if of}
    if "foreground" not in planes:
        raise ValueError(f"{path} has no part \"foreground\"")

    def layer(part, name):
        channels = planes[part]
        stem = f"{part}.{name}"
        if f"{stem}.Y" in channels:  # alike in all colours
            return np.repeat(channels[f"{stem}.Y"][..., None], 3, -1)
        return np.stack([channels[f"{stem}.{colour}"] for colour in "RGB"], -1)

    try:
        monitors = [Monitor(each.get("name", ""), each["width_px"], each["height_px"]) for each in metadata["monitors"]]
        modes = [{name: layer(part, name) for name in _LAYERS} for part in sorted(planes) if part != "foreground"]
        front = planes["foreground"]
        foreground = layer("foreground", "F")
        more = _replaced(pyramids, modes, foreground)
        return Matte(
            foreground=foreground,
            coverage=front["foreground.coverage.Y"],
            flags=front["foreground.flags.Y"].astype(np.uint8),
            modes=modes,
            monitors=monitors,
            is_box=metadata.get("footprint") == "box",
            crosstalk=_crosstalk(metadata, len(monitors)),
            warnings=metadata.get("warnings", []),
            more=more,
        )
    except KeyError as error:
        raise ValueError(f"{path} lacks {error.args[0]}") from None


_LEVELS = 5  # of pyramids
_HEAD = 9  # numbers before a pyramid's coefficients


def _end(numbers):
    """The length of a row's pyramids: x + 1, channel, texture, F', noise, prior, n, left, top, n steps from
    place to place, n weights."""
    end = 0
    while end < len(numbers) and numbers[end]:
        end += _HEAD + 2 * int(numbers[end + 6])
    if end > len(numbers):
        raise ValueError("its pyramids are longer than their row")
    return end


def _replaced(pyramids, modes, foreground):
    """Takes the modes for which pyramids stand out of `modes`, adds to F, and returns Matte.more."""
    width = foreground.shape[1]
    found = {name: [] for name in ("out", *_LAYERS)}
    for row, numbers in pyramids.items():
        while len(numbers):
            x, channel, texture, more_foreground, _, _, count, left, top = numbers[:_HEAD]
            step, weight = numbers[_HEAD : _HEAD + 2 * int(count)].reshape(2, -1)
            place = np.cumsum(step.astype(np.int64))
            numbers = numbers[_HEAD + 2 * int(count) :]
            at = row, int(x) - 1, int(channel)
            foreground[at] += more_foreground
            level, inside = np.divmod(place, 1 << 20)
            round_ones = level < _LEVELS
            scale = 2.0 ** level[round_ones]
            own = {"weight": weight[round_ones],
                   "x": scale * (2 * (left // scale + inside[round_ones] // 1024) + 1),
                   "y": scale * (2 * (top // scale + inside[round_ones] % 1024) + 1),
                   "xx": scale**2, "xy": 0 * scale, "yy": scale**2}
            kept = [(modes[int(l) - _LEVELS], w) for l, w in zip(level[~round_ones], weight[~round_ones])]
            for name in own:
                found[name].append(np.append(own[name], [w if name == "weight" else mode[name][at] for mode, w in kept]))
            found["texture"].append(np.full(int(count), texture))
            found["out"].append(np.full(int(count), (row * width + at[1]) * 3 + at[2]))
            for mode in modes:
                if mode["texture"][at] == texture:
                    mode["weight"][at] = 0
    return {name: np.concatenate(of) for name, of in found.items()} if found["out"] else {}


def _whole(part, planes, metadata):
    """The planes of the camera's picture: 0 around the data window of a file that hugs the object."""
    if "glasswing:delivery" not in part.text:
        return planes
    right = metadata["width_px"] - part.left - part.width
    below = metadata["height_px"] - part.top - part.height
    if min(part.left, part.top, right, below) < 0:
        raise ValueError("its pixels reach beyond the camera's picture")
    return {name: np.pad(plane, ((part.top, below), (part.left, right))) for name, plane in planes.items()}


def _crosstalk(metadata, count):
    """How the camera's channels see each monitor's light, and the inverse: (count matrices, matrix), or None."""
    given = [each.get("share") for each in metadata.get("crosstalk", [])]
    given = (given + [None] * count)[:count]
    if not any(given):
        return None
    shares = [np.array(share, float).reshape(3, 3) if share else None for share in given]
    shares = [None if share is None else share / share.sum(1, keepdims=True) for share in shares]
    mean = np.mean([share for share in shares if share is not None], 0)
    return [np.eye(3) if share is None else share for share in shares], np.linalg.inv(mean)
