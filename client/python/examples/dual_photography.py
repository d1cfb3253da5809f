#!/usr/bin/env python3
"""Shows a matte from both ends: the object as the camera sees it in front of a picture, and as the monitor would see it
while that picture is projected from the camera's place.

    export PYTHONPATH=$PWD/build/release/python
    client/python/examples/dual_photography.py vase.exr deploy/pictures/harbour.png -o dual.png

Left the composite; in the middle the monitor's view in white light; right the same, lit by the picture.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

import glasswing


def make(matte_file: str, picture_file: str, output: str, monitor: str | None) -> None:
    matte, picture = glasswing.Matte.read(matte_file), glasswing.read_picture(picture_file)
    name = monitor or matte.monitors[0]
    panels = [matte.composite({name: picture}), matte.from_monitor(name), matte.from_monitor(name, light=picture)]
    height = max(panel.shape[0] for panel in panels)
    sized = [glasswing.resized(panel, round(panel.shape[1] * height / panel.shape[0]), height) for panel in panels]
    gap = np.ones((height, max(4, height // 40), 3), np.float32)
    glasswing.write_picture(output, np.clip(np.hstack([sized[0], gap, sized[1], gap, sized[2]]), 0, 1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("matte", metavar="MATTE")
    parser.add_argument("picture", metavar="PICTURE", help="behind the object, and projected at it")
    parser.add_argument("-o", "--output", default="dual.png", metavar="FILE", help="default: %(default)s")
    parser.add_argument("--monitor", metavar="NAME", help="default: the matte's first")
    arguments = parser.parse_args()
    make(arguments.matte, arguments.picture, arguments.output, arguments.monitor)


if __name__ == "__main__":
    try:
        main()
    except (glasswing.Error, OSError) as error:
        sys.exit(f"dual_photography: {error}")
