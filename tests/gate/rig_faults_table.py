#!/usr/bin/python3
"""rig_faults_table.py SCENE [FAULT=STRENGTH[+FAULT=STRENGTH]...]...

Solves a rendered scene with faults of a rig (rig_faults.py), and prints for each: dB of the composites inside the object
(of all photographs' squared errors), the share of pixels that are wrong by more than 0.05 and how many of those are
flagged, and the warnings. GLASSWING_BIN: the programs; GLASSWING_SOLVER: another solver; GLASSWING_SOLVE: further arguments of
`glasswing-solver solve` (default: none); ROWS=FIRST:END: only these rows of the picture; SEED: of the faults."""

import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import rig_faults

BIN = pathlib.Path(os.environ["GLASSWING_BIN"])
WRONG = 0.05
ROWS = slice(*(int(row) for row in os.environ["ROWS"].split(":"))) if "ROWS" in os.environ else slice(None)


def run(*words: object) -> str:
    done = subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip() or done.stdout.strip())
    return done.stderr


def flags_of(matte: pathlib.Path) -> np.ndarray | None:
    try:
        import glasswing
    except ImportError:
        return None
    return np.asarray(glasswing.Matte.read(matte).flags)


def outcome(scene: pathlib.Path, faults: list[tuple[str, float]], seed: int) -> tuple[str, list[str]]:
    with tempfile.TemporaryDirectory() as name:
        directory = pathlib.Path(name)
        rig_faults.degrade(scene, directory / "frames", faults, seed=seed, rows=ROWS)
        run(BIN / "glasswing", "import", directory / "frames", "--archive", directory / "archive")
        matte = directory / "matte.exr"
        try:
            said = run(os.environ.get("GLASSWING_SOLVER", BIN / "glasswing-solver"), "solve", directory / "archive", matte,
                       *os.environ.get("GLASSWING_SOLVE", "").split())
        except RuntimeError as refused:
            return "refused", [str(refused)]
        inside = rig_faults.read_png(scene / "mask_true.png")[ROWS, :, 0] > 0.5
        squares, wrong = [], np.zeros(inside.shape, bool)
        for seen in sorted((scene / "ref").glob("*_obj.png")):
            photograph = seen.name[: -len("_obj.png")]
            picture = directory / "picture.png"
            run(BIN / "glasswing", "composite", matte, "--background", scene / f"stim/photo_{photograph}.png", "--linear",
                "-o", picture)
            error = rig_faults.read_png(picture) - rig_faults.read_png(seen)[ROWS]
            wrong |= (np.abs(error) > WRONG).any(-1)
            squares.append((error[inside] ** 2).mean())
        text = f"{-10 * np.log10(np.mean(squares)):5.1f} dB, {100 * wrong.mean():5.2f} % wrong"
        flags = flags_of(matte)
        if flags is not None and wrong.any():
            text += f", {100 * (flags[wrong] != 0).mean():3.0f} % of them flagged"
        return text, [line for line in said.splitlines() if line.startswith("warning: ")]


def main() -> None:
    scene = pathlib.Path(sys.argv[1])
    for words in sys.argv[2:]:
        faults = [] if words == "none" else [(name, float(value or 0)) for name, _, value in
                                             (word.partition("=") for word in words.split("+"))]
        text, warnings = outcome(scene, faults, seed=int(os.environ.get("SEED", "1")))
        print(f"{scene.name} {words}: {text}", *(f"\n    {warning}" for warning in warnings), sep="", flush=True)


if __name__ == "__main__":
    main()
