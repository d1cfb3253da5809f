"""The per-pixel data that mattes and rays share."""

from __future__ import annotations

import enum
from typing import Protocol

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float32]


class PixelFlag(enum.IntFlag):
    """Why a pixel is unreliable; 0 is good."""

    NOT_CONVERGED = 1
    SATURATED = 2
    """Frames clipped at this pixel."""
    POOR_FIT = 4
    """The residual exceeds the noise."""
    NO_DATA = 8
    """Not solved."""
    FILLED = 16
    """Filled from its neighbours: by "glasswing matte fill", or because the camera's pixel is bad."""
    DISTURBED = 32
    """Something moved during the capture, and this is not corrected."""


class _NativePixels(Protocol):
    @property
    def foreground(self) -> _Floats: ...
    @property
    def coverage(self) -> _Floats: ...
    @property
    def flags(self) -> npt.NDArray[np.uint8]: ...


class Pixels:
    """The arrays of H x W camera pixels that are independent of how the light behind the object is represented.

    They are read-only views into one copy of the data, which they keep alive.
    """

    _native: _NativePixels

    @property
    def foreground(self) -> _Floats:
        """H x W x 3: F, the light without monitors or surroundings; linear."""
        return self._native.foreground

    @property
    def coverage(self) -> _Floats:
        """H x W: 1 inside the object's silhouette, 0 outside, in between where the object covers part of the pixel.

        For rays from two mattes, the larger of both.
        """
        return self._native.coverage

    @property
    def flags(self) -> npt.NDArray[np.uint8]:
        """H x W: sums of ``PixelFlag``; for rays, those of both mattes."""
        return self._native.flags
