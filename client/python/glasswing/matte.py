"""Mattes: for every camera pixel, where on the monitors its light came from.

    C = F + sum over modes of R * integral over the monitor of G(x; c, S) T(x) dx

per colour channel (Chuang et al. 2000, eq. 12); docs/matte.md has every convention. Light is linear; monitor coordinates are
pixels, origin at the outer corner of the top-left pixel, x right, y down, pixel centres at +0.5.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from glasswing._native import NativeMatte
from glasswing.errors import InvalidInput
from glasswing.pictures import ErrorMap, Picture, as_picture, png_of
from glasswing.pixels import Pixels
from glasswing.v1 import matte_pb2

_Floats = npt.NDArray[np.float32]


@dataclasses.dataclass(frozen=True)
class Modes:
    """The footprints of all pixels, as arrays of H x W x 3 x M: rows, columns, channels, modes.

    An unused mode has weight 0. The widths of a footprint are the square roots of the eigenvalues of
    [[xx, xy], [xy, yy]]. The arrays are read-only views into the matte: copy one to change it.
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

    def _behind(self, backgrounds: Mapping[str, npt.ArrayLike]) -> list[_Floats | None]:
        unknown = [name for name in backgrounds if name not in self.monitors]
        if unknown:
            raise InvalidInput(f'there is no monitor "{unknown[0]}"; this matte has: {", ".join(self.monitors)}')
        return [
            as_picture(backgrounds[name], f"background {name}") if name in backgrounds else None
            for name in self.monitors
        ]
