"""Pictures as numpy arrays: H x W x 3 (rows from the top; red, green, blue), linear float32, 1.0 is full scale."""

from __future__ import annotations

import os
import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from glasswing import _native
from glasswing.errors import InvalidInput


class Picture(np.ndarray[Any, np.dtype[np.float32]]):
    """H x W x 3, linear light. Notebooks show it."""

    def _repr_png_(self) -> bytes | None:
        return png_of(self) if self.ndim == 3 and self.shape[2] == 3 and self.size else None


class ErrorMap(Picture):
    """H x W x 3, the standard error of each sample of a composite; NaN: not known.

    Notebooks show it scaled so that 99 % of the errors are below white, and transparent where they are not known.
    """

    def _repr_png_(self) -> bytes | None:
        if self.ndim != 3 or self.shape[2] != 3 or not self.size:
            return None
        known = np.isfinite(self).all(axis=2)
        white = max(float(np.percentile(self[known], 99)), 1e-9) if known.any() else 1.0
        return png_of(np.where(known[..., None], self, 0.0) / white, known.astype(np.float32))


def read_picture(path: str | os.PathLike[str]) -> Picture:
    """Reads a PNG, JPEG, TIFF or WebP (sRGB) or an OpenEXR file (linear). NotFound, or Damaged naming the file."""
    return _native.read_picture(os.fspath(path)).view(Picture)


def write_picture(path: str | os.PathLike[str], picture: npt.ArrayLike) -> None:
    """Writes linear light to .exr (float32), .png (8 bit sRGB) or .tif (16 bit sRGB), by the path's suffix."""
    _native.write_picture(os.fspath(path), as_picture(picture, "picture"))


def srgb_to_linear(codes: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """Converts sRGB codes (IEC 61966-2-1) to linear light. Any shape; uint8, uint16, or floats in [0, 1]."""
    array = np.asarray(codes)
    if array.dtype in (np.uint8, np.uint16):
        return _native.linear_of_srgb((array / np.float32(np.iinfo(array.dtype).max)).astype(np.float32))
    if not np.issubdtype(array.dtype, np.floating):
        raise InvalidInput(f"codes are of type {array.dtype}; they must be uint8, uint16 or floats in [0, 1]")
    return _native.linear_of_srgb(array.astype(np.float32))


def linear_to_srgb(light: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Converts linear light to 8-bit sRGB codes. Any shape; values are clamped to [0, 1]."""
    codes = _native.srgb_of_linear(np.asarray(light, np.float32))
    return (codes * np.float32(255) + np.float32(0.5)).astype(np.uint8)


def resized(picture: npt.ArrayLike, width_px: int, height_px: int) -> Picture:
    """Resamples a picture: by area when it shrinks, bilinearly when it grows."""
    return _native.resized(as_picture(picture, "picture"), width_px, height_px).view(Picture)


def encode_png16(picture: npt.ArrayLike) -> bytes:
    """Encodes a linear 16-bit PNG, the format in which pictures are sent to displays."""
    return _native.encode_png16(as_picture(picture, "picture"))


def encode_png8(codes: npt.NDArray[np.uint8]) -> bytes:
    """Encodes 8-bit codes, H x W x 3 or 4 (the last is alpha), as PNG."""
    height, width, channels = codes.shape

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", width, height, 8, 2 if channels == 3 else 6, 0, 0, 0)
    rows = np.zeros((height, 1 + width * channels), np.uint8)  # each row begins with its filter, none
    rows[:, 1:] = codes.reshape(height, -1)
    content = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows.tobytes())) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + content


_MAX_SHOWN_PX = 1024


def png_of(light: npt.ArrayLike, alpha: npt.NDArray[np.float32] | None = None) -> bytes:
    """The picture that notebooks show for linear light, H x W x 3: sRGB, with ``alpha``; for large pictures every n-th row
    and column."""
    shown = np.asarray(light)
    step = -(-max(shown.shape[:2]) // _MAX_SHOWN_PX)
    codes = linear_to_srgb(shown[::step, ::step])
    if alpha is not None:
        opaque = np.clip(alpha[::step, ::step], 0.0, 1.0) * 255 + 0.5
        codes = np.dstack([codes, opaque.astype(np.uint8)])
    return encode_png8(codes)


def as_picture(array: Any, what: str) -> npt.NDArray[np.float32]:
    """Returns the array as a picture. InvalidInput: it is not H x W x 3, or not floats."""
    picture = np.asarray(array)
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.size == 0:
        raise InvalidInput(f"{what} has the shape {picture.shape}; it must be height x width x 3")
    if not np.issubdtype(picture.dtype, np.floating):
        raise InvalidInput(
            f"{what} is of type {picture.dtype}; it must be linear light as floats; srgb_to_linear() converts codes"
        )
    return np.ascontiguousarray(picture, np.float32)
