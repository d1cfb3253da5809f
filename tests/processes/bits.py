"""Reads mattes as raw bits, without using Glasswing's code."""

from __future__ import annotations

import pathlib
import sys

from daemon import ROOT

sys.path.insert(0, str(ROOT / "tests/client/python"))
from exr_reader import read_exr  # noqa: E402

Planes = dict[tuple[str, str], list[bytes]]


def planes(matte: pathlib.Path) -> Planes:
    """The bytes of every row, by part and channel."""
    return {
        (part, channel): [row.tobytes() for row in plane]
        for part, channels in read_exr(matte).items()
        for channel, plane in channels.items()
    }


def rows_of(whole: Planes, first: int, count: int) -> Planes:
    """Rows `first` to `first + count - 1` of each plane."""
    return {name: rows[first : first + count] for name, rows in whole.items()}
