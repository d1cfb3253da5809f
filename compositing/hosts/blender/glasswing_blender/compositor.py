"""Puts pictures behind a matte's object, with numpy:

    C = F + sum over modes of R * integral over the monitor of G(x; c, S) T(x) dx

like `glasswing composite` (docs/compositing.md). Each footprint is looked up on the pyramid level that suits its narrowest
part: there it has the covariance Q = (S + I/2) / 4^l - I/2, in samples, and is integrated over flat samples row by row along
its wider axis. A row's cut of a Gaussian is a Gaussian, whose centre moves with the row.
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

# [1 5 10 10 5 1] / 32 along both axes makes a level of the one above; its variance is 5 (4^l - 1) / 12 px^2.
_HALVING = np.array([1, 5, 10, 10, 5, 1], np.float32) / 32
_MIN_SIDE = 4
_CHUNK = 4096  # footprints at a time, for the processor's caches
_MAX_LOOK_UPS = 4096  # of a footprint; beyond it a higher level is used, where it is widened to what that level can show


class _Gaussian:
    reach, min_variance, has_means = 3.0, 0.32, True
    _steps = 2048  # of a standard deviation
    _z = np.arange(-4 * _steps, 4 * _steps + 1) / _steps
    _below = np.array([0.5 * math.erfc(-z / math.sqrt(2)) for z in _z], np.float32)

    @classmethod
    def below(cls, z):
        """The part of the footprint below z standard deviations."""
        return cls._below.take((z * cls._steps + (4 * cls._steps + 0.5)).astype(np.int32), mode="clip")


class _Box:
    reach, min_variance, has_means = math.sqrt(3), 3.0, False

    @staticmethod
    def below(z):
        return np.clip(0.5 + z / (2 * math.sqrt(3)), 0, 1)


class _Pyramid:
    """Levels one after another, each with a dark sample beyond its edges, by channel."""

    def __init__(self, width, height):
        self.sizes = [(width, height)]
        while max(self.sizes[-1]) > _MIN_SIDE:
            self.sizes.append(tuple((side + 1) // 2 for side in self.sizes[-1]))
        self.strides = [w + 2 for w, _ in self.sizes]
        self.begins = np.concatenate([[0], np.cumsum([(w + 2) * (h + 2) for w, h in self.sizes])])

    @property
    def size(self):
        return int(self.begins[-1])

    def fill(self, picture, samples):
        """`picture`: (height, width, 3); `samples`: (3, size)."""
        level = picture
        for begin, end, (width, height) in zip(self.begins, self.begins[1:], self.sizes):
            if begin:
                level = _halved(_halved(level, 0, height), 1, width)
            samples[:, begin:end] = np.pad(level, ((1, 1), (1, 1), (0, 0))).transpose(2, 0, 1).reshape(3, -1)


def _halved(level, axis, count):
    level = np.moveaxis(level, axis, 0)
    dark = np.zeros((2 * count + 4, *level.shape[1:]), np.float32)
    dark[2 : 2 + len(level)] = level
    # A level has no samples beyond its edge: their light belongs to footprints that reach past the monitor.
    return np.moveaxis(sum(_HALVING[k] * dark[k : k + 2 * count : 2] for k in range(6)), 0, axis)


class _Footprints:
    """Arrays over footprints, each of one channel of one pixel."""

    _FIELDS = ("out", "weight", "u", "v", "uu", "uv", "vv", "begin", "u_step", "v_step", "u_size", "v_size", "rows", "taps")

    def __init__(self, **fields):
        self.__dict__.update(fields)

    def taken(self, which):
        return _Footprints(**{name: getattr(self, name)[which] for name in self._FIELDS})


class Compositor:
    """Prepared for one matte; then each set of pictures needs a pyramid and the look-ups."""

    def __init__(self, matte):
        self._matte = matte
        self._kind = _Box if matte.is_box else _Gaussian
        self._pyramids = [_Pyramid(monitor.width, monitor.height) for monitor in matte.monitors]
        self._begins = np.concatenate([[0], np.cumsum([3 * pyramid.size for pyramid in self._pyramids])])
        self._chunks = self._prepared()

    def composite(self, pictures, foreground_gain=1.0):
        """(height, width, 3) linear light. `pictures`: by monitor (its height, its width, 3) linear light, or None."""
        crosstalk = self._matte.crosstalk
        samples = np.zeros(int(self._begins[-1]), np.float32)
        for t, picture in enumerate(pictures):
            monitor = self._matte.monitors[t]
            if picture is None:
                continue
            if picture.shape != (monitor.height, monitor.width, 3):
                raise ValueError(f"the picture on {monitor.name} is {picture.shape[1]}x{picture.shape[0]}; "
                                 f"it must be {monitor.width}x{monitor.height}")
            if crosstalk:
                picture = picture @ crosstalk[0][t].T
            self._pyramids[t].fill(picture.astype(np.float32), samples[self._begins[t] : self._begins[t + 1]].reshape(3, -1))
        out = (foreground_gain * self._matte.foreground).ravel()
        with ThreadPoolExecutor(os.cpu_count()) as workers:
            for chunk, light in zip(self._chunks, workers.map(lambda chunk: self._light(chunk, samples), self._chunks)):
                np.add.at(out, chunk.out, chunk.weight * light)
        out = out.reshape(self._matte.foreground.shape)
        return out @ crosstalk[1].T.astype(np.float32) if crosstalk else out

    def _prepared(self):
        """Chunks of footprints with equal numbers of rows and samples."""
        chunks = []
        every = [self._placed(t) for t in range(len(self._matte.monitors))]
        for footprints in every:
            cost = footprints.rows * 65536 + footprints.taps
            order = np.argsort(cost, kind="stable")
            ends = np.flatnonzero(np.diff(cost[order])) + 1
            for group in np.split(order, ends):
                chunks += [footprints.taken(group[i : i + _CHUNK]) for i in range(0, len(group), _CHUNK)]
        return chunks

    def _placed(self, texture):
        """All footprints on a monitor, in samples of their levels."""
        found = {name: [] for name in ("out", "weight", "x", "y", "xx", "xy", "yy")}
        for mode in self._matte.modes:
            used = np.flatnonzero(((mode["weight"] > 0) & (mode["texture"] == texture)).ravel())
            found["out"].append(used)
            for name in ("weight", "x", "y", "xx", "xy", "yy"):
                found[name].append(mode[name].ravel()[used].astype(np.float64))
        if self._matte.more:
            used = self._matte.more["texture"] == texture
            for name, of in found.items():
                of.append(self._matte.more[name][used])
        f = {name: np.concatenate(of) for name, of in found.items()}
        pyramid = self._pyramids[texture]
        last = len(pyramid.sizes) - 1
        widths, heights = np.array(pyramid.sizes).T
        level = np.zeros(len(f["out"]), int)
        qs = {name: np.maximum(f[name], 0) if name != "xy" else f[name] for name in ("xx", "xy", "yy")}
        left = np.arange(len(level))  # those that the level before suits
        for l in range(1, last + 1):
            xx, xy, yy = _on_level(f, l, left)
            suits = (xx > 0) & (yy > 0) & (xx * yy - xy * xy >= self._kind.min_variance * np.maximum(xx, yy))
            left = left[suits]
            level[left], qs["xx"][left], qs["xy"][left], qs["yy"][left] = l, xx[suits], xy[suits], yy[suits]
        left = np.arange(len(level))  # those that take too many look-ups
        while True:
            rows, taps = self._extent(*(qs[name][left] for name in qs), widths[level[left]], heights[level[left]])
            left = left[(rows * taps > _MAX_LOOK_UPS) & (level[left] < last)]
            if not left.size:
                break
            level[left] += 1
            qs["xx"][left], qs["xy"][left], qs["yy"][left] = _widened(*_on_level(f, level[left], left), self._kind.min_variance)
        rows, taps = self._extent(qs["xx"], qs["xy"], qs["yy"], widths[level], heights[level])
        x, y = f["x"] * 0.5**level, f["y"] * 0.5**level
        turned = qs["xx"] > qs["yy"]  # v is the wider axis

        def either(a, b):
            return np.where(turned, a, b)

        strides = np.array(pyramid.strides)[level]
        channel = f["out"] % 3
        return _Footprints(
            out=f["out"],
            weight=f["weight"].astype(np.float32),
            u=either(y, x), v=either(x, y),
            uu=either(qs["yy"], qs["xx"]), uv=qs["xy"], vv=either(qs["xx"], qs["yy"]),
            begin=self._begins[texture] + channel * pyramid.size + pyramid.begins[level],
            u_step=either(strides, 1), v_step=either(1, strides),
            u_size=either(heights[level], widths[level]), v_size=either(widths[level], heights[level]),
            rows=rows, taps=taps,
        )

    def _extent(self, xx, xy, yy, width, height):
        """Rows along the wider axis, and samples of a row's cut; with few different values of each."""
        turned = xx > yy
        vv, uu = np.where(turned, xx, yy), np.where(turned, yy, xx)
        slope = np.divide(xy, vv, out=np.zeros_like(vv), where=vv > 0)
        cut = np.maximum(uu - slope * xy, 0) + slope * slope / 12
        rows = np.ceil(2 * self._kind.reach * np.sqrt(vv)).astype(int) + 1
        taps = np.ceil(2 * self._kind.reach * np.sqrt(cut)).astype(int) + 1

        def coarse(count, size):
            rounded = np.where(count > 16, -(-count // 16) * 16, np.where(count > 8, -(-count // 2) * 2, count))
            return np.minimum(rounded, size + 2)

        return coarse(rows, np.where(turned, width, height)), coarse(taps, np.where(turned, height, width))

    def _light(self, f, samples):
        """The integral of each of a chunk's footprints."""
        kind = self._kind
        rows, taps = int(f.rows[0]), int(f.taps[0])
        sigma = np.sqrt(np.maximum(f.vv, 1e-8))
        slope = np.where(f.vv > 1e-6, f.uv / np.maximum(f.vv, 1e-6), 0)
        cut = np.maximum(f.uu - slope * f.uv, 0)
        first = np.floor(f.v - 0.5 * (rows - 1))
        if rows % 2:  # the middle one holds the centre
            first = np.floor(f.v) - (rows - 1) // 2
        # Along v: the part in each row, and the mean and variance of v in it.
        z = (first[:, None] + np.arange(rows + 1) - f.v[:, None]) / sigma[:, None]
        below = kind.below(z)
        part = np.diff(below, axis=1)
        total = below[:, -1] - below[:, 0]
        if kind.has_means:
            density = np.exp(-0.5 * np.minimum(z * z, 80.0)) / math.sqrt(2 * math.pi)
            safe = np.maximum(part, 1e-6)
            mean = np.clip((density[:, :-1] - density[:, 1:]) / safe, z[:, :-1], z[:, 1:])
            square = 1 + (z[:, :-1] * density[:, :-1] - z[:, 1:] * density[:, 1:]) / safe - mean * mean
            square = np.clip(square, 0, (1 / sigma**2)[:, None] / 12)
        else:
            mean = square = np.zeros_like(part)
        light = np.zeros(len(f.out), np.float32)
        for row in range(rows):
            v = np.clip(first + row, -1, f.v_size).astype(np.int64) + 1
            centre = f.u + slope * sigma * mean[:, row]
            spread = np.sqrt(np.maximum(cut + (slope * sigma) ** 2 * square[:, row], 1e-8))
            left = np.floor(centre - 0.5 * (taps - 1)) if taps % 2 == 0 else np.floor(centre) - (taps - 1) // 2
            edges = kind.below((left[:, None] + np.arange(taps + 1) - centre[:, None]) / spread[:, None])
            u = np.clip(left[:, None] + np.arange(taps), -1, f.u_size[:, None]).astype(np.int64) + 1
            at = f.begin[:, None] + (v * f.v_step)[:, None] + u * f.u_step[:, None]
            seen = np.einsum("ij,ij->i", np.diff(edges, axis=1), samples.take(at))
            light += (part[:, row] * seen / np.maximum(edges[:, -1] - edges[:, 0], 1e-6)).astype(np.float32)
        return light / np.maximum(total, 1e-6)


def _on_level(f, level, which):
    """Q.xx, Q.xy, Q.yy of some footprints."""
    scale = 0.25**level
    return f["xx"][which] * scale + 0.5 * (scale - 1), f["xy"][which] * scale, f["yy"][which] * scale + 0.5 * (scale - 1)


def _widened(xx, xy, yy, least):
    """So that no axis of the ellipse has a variance below `least`."""
    mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    away = np.hypot(half, xy)
    wide = np.maximum(mean + away, least)
    narrow = np.maximum(mean - away, least)
    share = np.divide(0.5 * (wide - narrow), away, out=np.zeros_like(away), where=away > 0)
    return 0.5 * (wide + narrow) + share * half, xy * share, 0.5 * (wide + narrow) - share * half
