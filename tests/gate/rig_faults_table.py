#!/usr/bin/python3
"""rig_faults_table.py SCENE [FAULT=STRENGTH[+FAULT=STRENGTH]...]...

Solves a rendered scene with faults of a rig (rig_faults.py), and prints for each: dB of the composites inside the object
(of all photographs' squared errors), the rms of these errors over those that the matte states where it states one (z), the
share of pixels that are wrong by more than 0.05 and how many of those are flagged, and the warnings. GLASSWING_BIN: the programs; GLASSWING_SOLVER: another solver; GLASSWING_SOLVE: further arguments of
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


try:
    import glasswing
except ImportError:  # neither flags nor z
    glasswing = None


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
        squares, squares_of_z, wrong = [], [], np.zeros(inside.shape, bool)
        solved = glasswing and glasswing.Matte.read(matte)
        for seen in sorted((scene / "ref").glob("*_obj.png")):
            photograph = seen.name[: -len("_obj.png")]
            picture = directory / "picture.png"
            run(BIN / "glasswing", "composite", matte, "--background", scene / f"stim/photo_{photograph}.png", "--linear",
                "-o", picture)
            error = rig_faults.read_png(picture) - rig_faults.read_png(seen)[ROWS]
            wrong |= (np.abs(error) > WRONG).any(-1)
            squares.append((error[inside] ** 2).mean())
            if solved:
                behind = rig_faults.read_png(scene / f"stim/photo_{photograph}.png").astype(np.float32)
                stated = np.asarray(solved.error({name: behind for name in list(solved.monitors)[:1]}))
                squares_of_z.append(np.square(error / stated)[inside & (stated > 0).all(-1)])
        text = f"{-10 * np.log10(np.mean(squares)):5.1f} dB, {100 * wrong.mean():5.2f} % wrong"
        if solved:
            text += f", z {np.sqrt(np.mean(np.concatenate(squares_of_z))):4.1f}"
        if solved and wrong.any():
            text += f", {100 * (np.asarray(solved.flags)[wrong] != 0).mean():3.0f} % of them flagged"
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
