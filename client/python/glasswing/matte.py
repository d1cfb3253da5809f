"""Mattes: for every camera pixel, where on the monitors its light came from.

    C = F + sum over modes of R * integral over the monitor of G(x; c, S) T(x) dx

per colour channel (Chuang et al. 2000, eq. 12); docs/matte.md has every convention. Light is linear; monitor coordinates are
pixels, origin at the outer corner of the top-left pixel, x right, y down, pixel centres at +0.5.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from glasswing._native import NativeMatte
from glasswing.errors import InvalidInput
from glasswing.pictures import ErrorMap, Picture, as_picture, png_of
from glasswing.pixels import Pixels
from glasswing.v1 import matte_pb2

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

CHANNELS = ("r", "g", "b")
_Floats = npt.NDArray[np.float32]


@dataclasses.dataclass(frozen=True)
class Modes:
    """The footprints of all pixels, as arrays of H x W x 3 x M: rows, columns, channels, modes.

    An unused mode has weight 0. The widths of a footprint are the square roots of the eigenvalues of
    [[xx, xy], [xy, yy]]. The arrays are read-only views into the matte: copy one to change it. Where ``Matte.any_shape`` is
    true they are only the closest Gaussians.
    """

    weight: _Floats
    """R, the fraction of the radiance that reaches the camera; >= 0."""
    x_px: _Floats
    """Centre, monitor px."""
    y_px: _Floats
    xx_px2: _Floats
    """Covariance, monitor px^2."""
    xy_px2: _Floats
    yy_px2: _Floats
    texture: npt.NDArray[np.int32]
    """Index of the monitor in ``Matte.monitors``."""
    weight_sd: _Floats
    """Standard error of the weight; 0: not known."""
    centre_sd_px: _Floats
    """Standard error of the centre, rms of x and y; 0: not known."""


@dataclasses.dataclass(frozen=True)
class Transport:
    """A matte as a matrix; ``Matte.transport()`` makes one.

    Of one channel and in linear light, ``matrix @ picture + foreground`` is the composite: ``picture`` the light of all
    monitors' pixels as the camera's channel sees it, row by row, one monitor after the other; ``foreground`` the channel of
    ``Matte.foreground``, flattened. ``matrix.T @ light`` is the picture that a camera at the monitors would take while the
    camera shines ``light``. Entries of a row that together are a part of 1e-5 of it are left out.
    """

    matrix: csr_matrix
    """(H W) x (pixels of all monitors), float32."""
    sd: csr_matrix | None
    """Standard errors of the same entries due to noise; 0: not known. None: they were not asked for, or the footprints are
    boxes. If the matte does not record how it was sampled, they lack those of widths, and correlations of modes."""
    first_columns: dict[str, int]
    """The column of each monitor's first pixel."""


class Matte(Pixels):
    """A finished matte of H x W camera pixels; ``Session.fetch()`` and ``Matte.read()`` make one.

    Its arrays are read-only views into one copy of the data, which they keep alive.
    """

    _native: NativeMatte

    def __init__(self, native: NativeMatte) -> None:
        self._native = native
        self.metadata = matte_pb2.MatteMetadata.FromString(native.metadata)
        """The message MatteMetadata (proto/glasswing/v1/matte.proto): session, method, options, warnings and more."""

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Matte:
        """Reads a matte from a file. NotFound, or Damaged: truncated, altered or not a matte. Both name the path."""
        return cls(NativeMatte.read(os.fspath(path)))

    @classmethod
    def from_bytes(cls, content: bytes) -> Matte:
        """Decodes a matte from a file's content. Damaged: truncated, altered or not a matte."""
        return cls(NativeMatte.decode(content))

    def __repr__(self) -> str:
        height, width = self.coverage.shape
        return f"<matte of session {self.metadata.session}, {width}x{height}, method {self.metadata.method}>"

    @property
    def monitors(self) -> tuple[str, ...]:
        """Names of the monitors that its light came from; a mode's ``texture`` is an index into this."""
        return tuple(monitor.name for monitor in self.metadata.monitors)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What may be wrong with it, in readable sentences."""
        return tuple(self.metadata.warnings)

    @property
    def modes(self) -> Modes:
        """The footprints: where on the monitors the light came from."""
        return Modes(**{field.name: getattr(self._native, field.name) for field in dataclasses.fields(Modes)})

    @property
    def any_shape(self) -> npt.NDArray[np.bool_]:
        """H x W: where a channel has a footprint of any shape (docs/footprints.md), which ``footprint()`` reads."""
        return self._native.has_pyramid

    def footprint(self, column: int, row: int, monitor: str | None = None) -> Picture:
        """Where on a monitor a pixel's light comes from: h x w x 3, the share of each of its pixels, by channel.

        It sums to the weight of the pixel's footprints on that monitor, less what lies beyond its edge; times a picture of
        linear light and summed, it is what the pixel sees of it. All kinds of footprints are read: modes, boxes and those of
        any shape. ``monitor``: default: the first. Releases the GIL.

        InvalidInput: the matte has no such monitor or pixel.
        """
        name = self.monitors[0] if monitor is None else monitor
        if name not in self.monitors:
            raise InvalidInput(f'there is no monitor "{name}"; this matte has: {", ".join(self.monitors)}')
        height, width = self.coverage.shape
        if not (0 <= column < width and 0 <= row < height):
            raise InvalidInput(f"there is no pixel {column}, {row}; this matte has {width}x{height}")
        return self._native.footprint(column, row, self.monitors.index(name)).view(Picture)

    def _repr_png_(self) -> bytes:
        """What notebooks show: F plus half of the light that white monitors would contribute, with coverage as alpha."""
        return png_of(self.foreground + 0.5 * self._native.weight.sum(axis=3), self.coverage)

    def composite(
        self, backgrounds: Mapping[str, npt.ArrayLike], *, exact: bool = False, threads: int = 0
    ) -> Picture:
        """Composites the object over other pictures: H x W x 3, linear, not clamped.

        ``backgrounds``: for each monitor a picture of linear light, h x w x 3; it is scaled to the monitor's size. Monitors
        that are not named are black. The first call prepares the matte; later ones are much faster. ``exact``: integrates
        every footprint, far more slowly; the default agrees with it to 0.002 of full scale (rms). ``threads``: 0 uses all
        cores; the result does not depend on it. Releases the GIL.

        InvalidInput: the matte has no such monitor, or a background is not a picture of linear light.
        """
        return self._native.composite(self._behind(backgrounds), exact, threads).view(Picture)

    def error(self, backgrounds: Mapping[str, npt.ArrayLike], *, threads: int = 0) -> ErrorMap:
        """The standard error of each sample of that composite due to noise: H x W x 3; NaN where it is not known.

        It is unknown outside the object, and at flagged pixels. Arguments and errors as for ``composite()``; Refused: the
        matte does not record how it was sampled, which only method "gaussian" does. Releases the GIL.
        """
        return self._native.error(self._behind(backgrounds), threads).view(ErrorMap)

    def transport(self, channel: str = "g", *, errors: bool = False, threads: int = 0) -> Transport:
        """The matte as a sparse matrix: how much of the light of each monitor pixel reaches each camera pixel.

        ``channel``: "r", "g" or "b", as the camera sees it. ``errors``: with the standard error of each entry, which takes
        about twice as long. ``threads`` as for ``composite()``. Needs SciPy (python3-scipy); releases the GIL.

        InvalidInput: no such channel. Refused: more than 2^32 entries.
        """
        if channel not in CHANNELS:
            raise InvalidInput(f'channel is "{channel}"; it must be one of: {", ".join(CHANNELS)}')
        from scipy.sparse import csr_matrix

        values, sd, columns, starts = self._native.transport(CHANNELS.index(channel), errors, threads)
        # Of one type, the smaller if it suffices; SciPy would convert both to the larger.
        index_type = np.int32 if len(columns) <= np.iinfo(np.int32).max else np.int64
        sizes = [monitor.width_px * monitor.height_px for monitor in self.metadata.monitors]
        shape = (self.coverage.size, sum(sizes))

        def matrix(data: _Floats) -> csr_matrix:
            return csr_matrix((data, columns.astype(index_type), starts.astype(index_type)), shape=shape, copy=False)

        return Transport(
            matrix=matrix(values),
            sd=None if sd is None else matrix(sd),
            first_columns=dict(zip(self.monitors, (sum(sizes[:index]) for index in range(len(sizes))))),
        )

    def from_monitor(
        self, monitor: str | None = None, *, light: npt.ArrayLike | None = None, threads: int = 0
    ) -> Picture:
        """The picture as the monitor would see it while the camera's place shines: h x w x 3, linear, not clamped.

        ``monitor``: default: the first. ``light``: what shines, a picture of linear light, which is scaled to the camera's
        size; default: white. It is the transpose of ``composite()`` without F, times monitor pixels per camera pixel.
        Releases the GIL.

        InvalidInput: the matte has no such monitor, or ``light`` is not a picture of linear light.
        """
        name = self.monitors[0] if monitor is None else monitor
        if name not in self.monitors:
            raise InvalidInput(f'there is no monitor "{name}"; this matte has: {", ".join(self.monitors)}')
        shone = None if light is None else as_picture(light, "light")
        return self._native.from_monitor(self.monitors.index(name), shone, threads).view(Picture)

    def _behind(self, backgrounds: Mapping[str, npt.ArrayLike]) -> list[_Floats | None]:
        unknown = [name for name in backgrounds if name not in self.monitors]
        if unknown:
            raise InvalidInput(f'there is no monitor "{unknown[0]}"; this matte has: {", ".join(self.monitors)}')
        return [
            as_picture(backgrounds[name], f"background {name}") if name in backgrounds else None
            for name in self.monitors
        ]
