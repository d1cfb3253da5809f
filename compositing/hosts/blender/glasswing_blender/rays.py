"""A file of rays as arrays (docs/rays.md): mm in the camera's frame, x right, y down, z forward."""

import json
import re
from dataclasses import dataclass, field

import numpy as np

from . import exr

UNKNOWN, STRAIGHT = 3, 4  # states
_VECTORS = ("origin", "direction", "origin_u", "origin_v", "direction_u", "direction_v")


@dataclass
class Camera:
    """A pinhole with OpenCV's distortion, of continuous pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float]  # k1, k2, p1, p2, k3

    def directions(self, pixels):
        """(N, 3) unit vectors to positions in the picture, (N, 2)."""
        k1, k2, p1, p2, k3 = self.distortion
        distorted = (np.asarray(pixels, float) - (self.cx, self.cy)) / (self.fx, self.fy)
        u = distorted.copy()
        for _ in range(50):
            x, y = u.T
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            u += distorted - np.stack([x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                                       y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], -1)
        d = np.column_stack([u, np.ones(len(u))])
        return d / np.linalg.norm(d, axis=1, keepdims=True)


@dataclass
class Rays:
    """Arrays of (height, width), and of `rays` of (N,), each a bundle in one channel of one pixel, by name."""

    foreground: np.ndarray  # (height, width, 3)
    coverage: np.ndarray  # 0 outside the object
    camera: Camera
    normal: np.ndarray  # of the nearest monitor, away from the camera
    depth: float  # of that monitor along its normal
    pixel: np.ndarray  # (N,), row by row
    channel: np.ndarray  # (N,): 0 red, 1 green, 2 blue
    index: np.ndarray  # (N,): of the ray in its channel and pixel
    state: np.ndarray
    weight: np.ndarray
    vectors: dict[str, np.ndarray]  # (N, 3): origin, direction, origin_u, origin_v, direction_u, direction_v
    warnings: list[str] = field(default_factory=list)


def read_rays(path):
    """Raises OSError, or ValueError that says what is wrong with the file."""
    parts = exr.read_parts(path, lambda name: name == "foreground" or re.fullmatch(r"ray\d+", name))
    text = parts[0][0].text
    if "glasswing:rays" not in text:
        what = "holds a matte; glasswing rays makes rays from it" if "glasswing" in text else "is not a file of glasswing rays"
        raise ValueError(f"{path} {what}")
    metadata = json.loads(text["glasswing:rays"])
    if metadata.get("format_version") != 1:
        raise ValueError(f"{path} has format {metadata.get('format_version')}; this add-on reads 1")
    planes = {part.name: of for part, of in parts if of}
    try:
        front = planes.pop("foreground")
        normal, depth = _nearest_monitor(metadata)
        warnings = [metadata["approximation"]] if metadata.get("approximation") else []
        if metadata["matte"].get("crosstalk"):
            warnings.append("The monitor's primaries leak into the camera's channels, which a material cannot reproduce: colours are off by the amount of the leak")
        return Rays(
            foreground=np.stack([front[f"foreground.F.{colour}"] for colour in "RGB"], -1),
            coverage=front["foreground.coverage.Y"],
            camera=_camera(metadata["geometry"]["camera"]),
            normal=normal,
            depth=depth,
            warnings=warnings,
            **_used(planes),
        )
    except KeyError as error:
        raise ValueError(f"{path} lacks {error.args[0]}") from None


def _camera(of):
    return Camera(of["width_px"], of["height_px"], of["fx_px"], of["fy_px"], of["cx_px"], of["cy_px"],
                  tuple(of.get(name, 0.0) for name in ("k1", "k2", "p1", "p2", "k3")))


def _nearest_monitor(metadata):
    [pose, *_] = [each for each in metadata["geometry"]["monitors"] if each.get("name", "") == metadata["poses"][0]] or [None]
    if pose is None:
        raise KeyError(f"the pose {metadata['poses'][0]}")
    normal = np.reshape(pose["rotation"], (3, 3))[:, 2]
    return normal, float(normal @ pose["translation_mm"])


def _used(planes):
    """The fields of Rays over all rays that have weight, in the order of pixels."""
    found = {name: [] for name in ("pixel", "channel", "index", "state", "weight", *_VECTORS)}
    for part in sorted(planes, key=lambda name: int(name[3:])):
        channels = planes.pop(part)
        for c, colour in enumerate("RGB"):
            weight = channels[f"{part}.weight.{colour}"].ravel()
            used = np.flatnonzero(weight > 0)
            found["pixel"].append(used)
            found["channel"].append(np.full(len(used), c))
            found["index"].append(np.full(len(used), int(part[3:]) - 1))
            found["state"].append(channels[f"{part}.state.{colour}"].ravel()[used].astype(int))
            found["weight"].append(weight[used])
            for name in _VECTORS:
                found[name].append(np.stack([channels[f"{part}.{name}_{axis}.{colour}"].ravel()[used] for axis in "xyz"], -1))
    joined = {name: np.concatenate(of) for name, of in found.items()}
    order = np.lexsort((joined["channel"], joined["index"], joined["pixel"]))
    joined = {name: of[order] for name, of in joined.items()}
    return {**{name: joined[name] for name in ("pixel", "channel", "index", "state", "weight")},
            "vectors": {name: joined[name].astype(float) for name in _VECTORS}}
