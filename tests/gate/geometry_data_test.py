#!/usr/bin/python3
"""The camera of a rendered rig (L_depth) from photographs of its bare monitor at six poses, as a user calibrates it:
import, solve, calibrate geometry; against the scene's own camera and poses."""

import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

BIN = pathlib.Path(os.environ["GLASSWING_BIN"])
SCENE = pathlib.Path(os.environ.get("GLASSWING_DATA", "/nonexistent")) / "rendered/dev2/L_depth"
POSES = 6


def run(*words: object) -> str:
    return subprocess.run([str(word) for word in words], check=True, stdout=subprocess.PIPE, text=True).stdout


def photograph_list() -> str:
    """What each photograph shows: solids, and bars of 128 / 2^level px, each with its inverse."""
    lines = ["#monitor back:128x96", "#response linear", "file\tobject\tkind\torient\tbar_width_px\tinverse\tcolour"]
    for name, light in (("black", 0), ("white", 1)):
        lines.append(f"solid_{name}.png\tfalse\tsolid\t\t\t\t{light},{light},{light}")
    for letter, bars in (("v", "vertical_bars"), ("h", "horizontal_bars")):
        for level in range(1, 8):
            for suffix, inverse in (("", "false"), ("_inv", "true")):
                width = 128 / 2**level
                lines.append(f"square_{letter}_{level}{suffix}.png\tfalse\tsquare\t{bars}\t{width:g}\t{inverse}\t")
    return "\n".join(lines) + "\n"


def calibrated(directory: pathlib.Path) -> dict:
    (directory / "list.tsv").write_text(photograph_list())
    mattes = []
    for pose in range(POSES):
        archive = directory / f"pose{pose}"
        mattes.append(directory / f"pose{pose}.exr")
        run(BIN / "glasswing", "import", SCENE / f"bare/pose{pose}", "--list", directory / "list.tsv", "--archive", archive)
        run(BIN / "glasswing-solver", "solve", archive, mattes[-1], "--method", "hierarchical")
    words = ("calibrate", "geometry", *mattes, "--pitch-mm", 1, "-o", directory / "rig.txtpb")
    return json.loads(run(BIN / "glasswing", "--json", *words))


def numbers_in(text: str, field: str) -> list[float]:
    """All values of a repeated field in a file of protobuf text."""
    values = []
    for line in text.splitlines():
        name, _, value = line.strip().partition(": ")
        if name == field:
            values.append([float(number) for number in value.strip("[]").split(",")])
    return values


def degrees_between(a: list[float], b: list[float]) -> float:
    """Of two rotation matrices, row by row: trace(A B') = 1 + 2 cos."""
    trace = sum(x * y for x, y in zip(a, b))
    return math.degrees(math.acos(max(-1.0, min(1.0, (trace - 1.0) / 2.0))))


def main() -> int:
    if not SCENE.exists():
        print(f"no data at {SCENE}; set GLASSWING_DATA")
        return 77
    truth = json.loads((SCENE / "truth.json").read_text())
    with tempfile.TemporaryDirectory() as temporary:
        fit = calibrated(pathlib.Path(temporary))
        text = (pathlib.Path(temporary) / "rig.txtpb").read_text()
    camera = truth["camera"]
    failures = []

    def check(name: str, value: float, limit: float) -> None:
        print(f"{name}: {value:.5f}, at most {limit}")
        if not abs(value) <= limit:
            failures.append(name)

    print("warnings:", fit["warnings"])
    # Regressions, a little above what was measured; the goal for the residual is 0.1 px.
    check("residual, median px", fit["median_px"], 0.11)
    check("residual, rms px", fit["rms_px"], 0.15)
    for axis in ("fx", "fy"):
        check(f"{axis} off by, share", fit[f"{axis}_px"] / camera[axis] - 1.0, 0.001)
        print(f"  standard error, share: {fit[f'{axis}_sd_px'] / camera[axis]:.5f}")
    for axis in ("cx", "cy"):
        check(f"{axis} off by, share of the width", (fit[f"{axis}_px"] - camera[axis]) / camera["width"], 0.001)
        print(f"  standard error, px: {fit[f'{axis}_sd_px']:.4f}")
    # At the picture's corner: k1 alone trades off against the others.
    u = math.hypot(80, 60) / camera["fx"]
    found = fit["k1"] * u**3 + fit["k2"] * u**5 + fit["k3"] * u**7
    check("distortion at the corner off by, px", camera["fx"] * (found - camera["k1"] * u**3), 0.1)
    rotations, translations = numbers_in(text, "rotation"), numbers_in(text, "translation_mm")
    for pose, bare in enumerate(truth["bare"]):
        distance = math.hypot(*bare["t"])
        check(f"pose {pose} off by, share of its distance", math.dist(translations[pose], bare["t"]) / distance, 0.001)
        turn = degrees_between(rotations[pose], [value for row in bare["R"] for value in row])
        check(f"pose {pose} turned by, degrees", turn, 0.05)  # a regression: the goal is 0.02
    if failures:
        print("missed:", ", ".join(failures))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
