"""Pictures under affine maps."""

import numpy as np


def area(picture, width, height):
    """The mean light of the part of `picture` that each of width x height pixels covers."""
    for axis, count in ((0, height), (1, width)):
        lines = np.moveaxis(picture, axis, 0)
        if len(lines) == count:
            continue
        summed = np.concatenate([np.zeros((1, *lines.shape[1:])), np.cumsum(lines, 0, dtype=np.float64)])
        edges = np.linspace(0, len(lines), count + 1)
        at = np.minimum(edges.astype(int), len(lines) - 1)
        below = summed[at] + (edges - at)[:, None, None] * lines[at]
        picture = np.moveaxis(np.diff(below, axis=0) * (count / len(lines)), 0, axis)
    return picture.astype(np.float32)


def warped(picture, affine, width, height):
    """(height, width, channels): `picture` sampled through the (2, 3) `affine` map for each pixel, in px from the outer
    corners.

    Linear between pixels, from a picture that is first reduced to the resolution at which it will be seen. Beyond the edges
    its edge pixels continue.
    """
    affine = np.array(affine, float)
    step = np.maximum(np.abs(affine[:, :2]).max(1), 1)
    sizes = [max(1, round(side / each)) for side, each in zip((picture.shape[1], picture.shape[0]), step)]
    affine *= (np.array(sizes) / (picture.shape[1], picture.shape[0]))[:, None]
    picture = area(picture, *sizes)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    u = np.clip(affine[0, 0] * x + affine[0, 1] * y + affine[0, 2] - 0.5, 0, sizes[0] - 1)
    v = np.clip(affine[1, 0] * x + affine[1, 1] * y + affine[1, 2] - 0.5, 0, sizes[1] - 1)
    left, up = u.astype(int), v.astype(int)
    right, down = np.minimum(left + 1, sizes[0] - 1), np.minimum(up + 1, sizes[1] - 1)
    u, v = (u - left).astype(np.float32)[..., None], (v - up).astype(np.float32)[..., None]
    return (picture[up, left] * (1 - u) + picture[up, right] * u) * (1 - v) + (
        picture[down, left] * (1 - u) + picture[down, right] * u) * v


def inverse(affine):
    whole = np.linalg.inv(np.vstack([affine, [0, 0, 1]]))
    return whole[:2]


def chained(outer, inner):
    """The map that applies `inner` first."""
    return outer @ np.vstack([inner, [0, 0, 1]])


def stretched(picture, monitor, scale=1.0, dx=0.0, dy=0.0):
    """The picture over a monitor's `width` and `height`, scaled about its centre, then moved by monitor px."""
    x, y = picture.shape[1] / (monitor.width * scale), picture.shape[0] / (monitor.height * scale)
    affine = [[x, 0, 0.5 * picture.shape[1] - (0.5 * monitor.width + dx) * x],
              [0, y, 0.5 * picture.shape[0] - (0.5 * monitor.height + dy) * y]]
    return warped(picture, affine, monitor.width, monitor.height)
