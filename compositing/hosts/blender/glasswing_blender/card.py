"""Rays as a card: for each bundle of a pixel a facet of that pixel's size, seen by the camera only, which redirects the
camera's ray along the bundle. Independent of Blender; mm in the camera's frame.

A bundle's line and the camera's ray cross if an object refracts light in one plane, and nearly do otherwise. A facet is
placed there, so that light continues from the right place; a pixel's facets are behind one another, and all but the last
also let all light through, so that their sums are C = F + sum of weight * light.
"""

from dataclasses import dataclass

import numpy as np

from .rays import STRAIGHT, UNKNOWN

_AGREE = 0.02  # px of the camera: within it, channels share a facet
_SURE_SINE = 0.1  # of the angle between two lines whose crossing determines the object's distance
_PULL = 0.02  # the sine at which a crossing has the same weight as the object's distance
_SHARE = 0.05  # of the light whose crossings are nearer or farther than any facet
_BEFORE = 0.98  # of the distance to the nearest monitor and to the exact plane: facets are in front of it
_GAP = 2e-4  # of the distance, between the facets of a pixel
_MIN_COSINE = 0.02  # of a bundle with the exact plane


@dataclass
class Card:
    """n facets, in the order of pixels, a pixel's nearest first."""

    corners: np.ndarray  # (n, 4, 3), mm; anticlockwise as the camera sees them
    # Light continues towards target + u target_u + v target_v, u and v independent with standard deviation 1: for `finite`
    # facets a point, for others a direction.
    target: np.ndarray  # (n, 3)
    target_u: np.ndarray
    target_v: np.ndarray
    finite: np.ndarray  # (n,): 1 or 0
    weight: np.ndarray  # (n, 3): by colour
    through: np.ndarray  # (n, 3): what passes straight on
    light: np.ndarray  # (n, 3): F, on the nearest facet of a pixel
    max_facets: int  # of a pixel
    distance: float  # of the object, mm


def card_of(rays, exact_depth=0.0):
    """`exact_depth`: light meets the plane parallel to the nearest monitor at this depth (mm) where the rays do, with their
    width there; 0: all directions are exact, and so are far objects. Raises ValueError: nothing is inside the object."""
    bent = _merged(rays)
    width, height = rays.camera.width, rays.camera.height
    axes = rays.camera.directions(_grid(width, height) + 0.5)
    axis = axes[bent["pixel"]]
    behind = min(rays.depth, exact_depth) if exact_depth > 0 else rays.depth
    behind = _BEFORE * behind / np.maximum(axes @ rays.normal, 1e-6)  # along each camera ray
    reach, distance = _reaches(rays, bent, axis, behind[bent["pixel"]])
    bare = np.setdiff1d(np.flatnonzero(rays.coverage.ravel() > 0), bent["pixel"])  # opaque, or all light goes straight on
    if not len(bare) + len(reach):
        raise ValueError("no pixel is inside the object")

    pixel = np.concatenate([bent["pixel"], bare])
    reach = np.concatenate([reach, np.minimum(distance, behind[bare])])
    order = np.lexsort((reach, pixel))
    pixel, reach = pixel[order], reach[order]
    first = np.concatenate([[True], pixel[1:] != pixel[:-1]])
    last = np.concatenate([first[1:], [True]])
    rank = np.arange(len(pixel)) - np.maximum.accumulate(np.where(first, np.arange(len(pixel)), 0))
    reach = reach * (1 + _GAP * rank)

    corners = rays.camera.directions(_grid(width + 1, height + 1))
    start = pixel // width * (width + 1) + pixel % width
    axis = axes[pixel][:, None]
    quads = corners[start[:, None] + [0, width + 1, width + 2, 1]]
    quads = quads * (reach[:, None, None] / np.sum(quads * axis, -1, keepdims=True))

    def ordered(values):
        return np.concatenate([values, np.zeros((len(bare), *values.shape[1:]))])[order]

    target, target_u, target_v, finite = (ordered(each) for each in _targets(rays, bent, exact_depth))
    straight = np.zeros((width * height, 3))
    ahead = rays.state == STRAIGHT
    np.add.at(straight, (rays.pixel[ahead], rays.channel[ahead]), rays.weight[ahead])
    return Card(
        corners=quads, target=target, target_u=target_u, target_v=target_v, finite=finite, weight=ordered(bent["weight"]),
        through=np.where(last[:, None], straight[pixel], 1.0),
        light=np.where(first[:, None], rays.foreground.reshape(-1, 3)[pixel], 0.0),
        max_facets=int(rank.max()) + 1, distance=distance,
    )


def _grid(width, height):
    """(width * height, 2): columns and rows, row by row."""
    y, x = np.mgrid[:height, :width]
    return np.stack([x.ravel(), y.ravel()], -1).astype(float)


def _merged(rays):
    """All bent bundles, with those that agree in all channels of a pixel as one: pixel, state, vectors, and weight by
    colour."""
    bent = np.flatnonzero(rays.state != STRAIGHT)
    pixel, index = rays.pixel[bent], rays.index[bent]
    vectors = {name: of[bent] for name, of in rays.vectors.items()}
    weight = np.zeros((len(bent), 3))
    weight[np.arange(len(bent)), rays.channel[bent]] = rays.weight[bent]
    # Channels of a ray follow one another.
    whole = np.flatnonzero((pixel[:-2] == pixel[2:]) & (index[:-2] == index[2:])) if len(bent) > 2 else np.zeros(0, int)
    allowed = _AGREE / rays.camera.fx
    for name, of in vectors.items():
        scale = allowed * (rays.depth if name.startswith("origin") else 1.0)
        apart = np.maximum(np.abs(of[whole + 1] - of[whole]).max(1), np.abs(of[whole + 2] - of[whole]).max(1))
        whole = whole[apart <= scale]
    weight[whole] += weight[whole + 1] + weight[whole + 2]
    kept = np.ones(len(bent), bool)
    kept[whole + 1] = kept[whole + 2] = False
    return {"pixel": pixel[kept], "state": rays.state[bent][kept], "weight": weight[kept],
            **{name: of[kept] for name, of in vectors.items()}}


def _reaches(rays, bent, axis, behind):
    """The facets' distances along the camera's rays, and the object's distance."""
    along = np.sum(axis * bent["direction"], 1, keepdims=True)
    across = axis - along * bent["direction"]
    square = np.sum(across**2, 1)  # of the sine
    crossing = np.sum(across * bent["origin"], 1)  # times `square`
    sure = np.flatnonzero((square > _SURE_SINE**2) & (bent["state"] != UNKNOWN))
    reach = crossing[sure] / square[sure]
    sure, reach = sure[reach > 0], reach[reach > 0]
    if not len(sure):
        return np.minimum(0.5 * rays.depth, behind), 0.5 * rays.depth
    order = np.argsort(reach)
    light = np.cumsum(bent["weight"][sure[order]].sum(1))
    nearest, distance, farthest = (float(reach[order[np.searchsorted(light, share * light[-1])]])
                                   for share in (_SHARE, 0.5, 1 - _SHARE))
    known = bent["state"] != UNKNOWN
    reach = np.where(known, crossing + _PULL**2 * distance, distance) / np.where(known, square + _PULL**2, 1)
    return np.minimum(np.clip(reach, nearest, farthest), behind), distance


def _targets(rays, bent, exact_depth):
    origin, direction = bent["origin"], bent["direction"]
    cosine = direction @ rays.normal
    finite = (cosine > _MIN_COSINE) & (exact_depth > 0)
    cosine = np.where(finite, cosine, 1)
    along = ((exact_depth - origin @ rays.normal) / cosine)[:, None]

    def on_plane(moved):
        return moved - direction * (moved @ rays.normal / cosine)[:, None]

    which = finite[:, None]
    return (np.where(which, origin + along * direction, direction),
            np.where(which, on_plane(bent["origin_u"] + along * bent["direction_u"]), bent["direction_u"]),
            np.where(which, on_plane(bent["origin_v"] + along * bent["direction_v"]), bent["direction_v"]),
            finite.astype(float))
