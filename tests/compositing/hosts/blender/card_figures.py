#!/usr/bin/python3
"""Measures rays in Blender's scenes against `glasswing composite --exact` (docs/blender.md), and keeps the pictures.

    card_figures.py DIRECTORY [NAME...]

In the environment deploy/pictures/lake.jpg: a sphere of glass in closed form, clear and frosted. Of the rendered scene
L_depth, where it is (GLASSWING_DATA): planes at several depths, exact there, elsewhere and far away, and its environment. PSNR is of
linear light where the object is; L_depth's lens bends the picture, so its render is six times finer and is averaged where
each pixel is. DIRECTORY/NAME.png has the composite, the render, and five times their difference.
"""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[4]
BIN = pathlib.Path(os.environ.setdefault("GLASSWING_BIN", str(ROOT / "build/release/bin")))
sys.path[:0] = [str(BIN.parent / "python"), str(ROOT / "tests/gate")]
import glasswing  # noqa: E402
ADDON = BIN.parent / "blender/glasswing_blender.zip"
SCENE = pathlib.Path(os.environ.setdefault("GLASSWING_DATA", str(ROOT.parent / "shared/data"))) / "rendered/dev2/L_depth"
SAMPLES, FINER, POINTS = 1024, 6, 12


def run(*words):
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def depth_rays(directory):
    if not (directory / "rays.exr").exists():
        import correspondences_data_test

        correspondences_data_test.correspondences(json.loads((SCENE / "truth.json").read_text()), directory)
    return directory / "rays.exr"


def all_cases(directory):
    """{name: (file of rays, finer, exact depth, words of glasswing composite, what stands behind)}"""
    lake = ROOT / "deploy/pictures/lake.jpg"
    still = str(directory / "still.exr")
    cases = {}

    def add_plane(name, rays, finer, depth, exact):
        name = f"{name}: plane at {depth}, exact {exact or 'far away'}"
        cases[name] = rays, finer, exact, ["--plane", f"{depth}:{still}"], {"planes": [{"depth": depth, "picture": still}]}

    for name, frost in (("clear", 0), ("frosted", 5)):
        run(BIN / "glass-sphere", 160, 120, frost, directory / f"{name}.exr")
        run(BIN / "glasswing", "convert", lake, directory / "lake.exr")
        environment = str(directory / "lake.exr")
        behind = {"environment": environment}
        cases[f"sphere, {name}: environment, exact far away"] = (
            directory / f"{name}.exr", 1, 0, ["--environment", environment], behind)
    if SCENE.exists():
        rays, sky = depth_rays(directory), str(directory / "sky.exr")
        run(BIN / "glasswing", "convert", SCENE / "env.exr", sky)
        run(BIN / "glasswing", "convert", SCENE / "near/stim/photo_stilllife.png", still)
        cases["L_depth: environment, exact far away"] = rays, FINER, 0, ["--environment", sky], {"environment": sky}
        add_plane("sphere, clear", directory / "clear.exr", 1, 300.0, 0.0)
        for depth in (200.0, 225.6, 251.2, 302.4):
            for exact in (depth, 0.0):
                add_plane("L_depth", rays, FINER, depth, exact)
        for depth in (251.2, 400.0):
            add_plane("L_depth", rays, FINER, depth, 302.4)
    return cases


def averaged(picture, rays, finer):
    """Of a pinhole's finer picture the mean over each of the camera's pixels, and where all of that is in it."""
    height, width = rays.coverage.shape
    matrix, k1 = rays.camera_matrix, rays.distortion[0]
    y, x = (np.mgrid[: height * POINTS, : width * POINTS] + 0.5) / POINTS
    distorted = np.stack([(x - matrix[0, 2]) / matrix[0, 0], (y - matrix[1, 2]) / matrix[1, 1]], -1)
    slopes = distorted
    for _ in range(50):
        slopes = distorted / (1 + k1 * np.sum(slopes**2, -1, keepdims=True))
    at = np.floor((slopes * np.diag(matrix)[:2] + matrix[:2, 2]) * finer).astype(int)
    inside = ((at >= 0) & (at < np.array([width, height]) * finer)).all(-1)
    found = picture[np.where(inside, at[..., 1], 0), np.where(inside, at[..., 0], 0)]

    def shape(each):
        return each.reshape(height, POINTS, width, POINTS, -1)

    return shape(found).mean((1, 3)), shape(inside).all((1, 3))[..., 0]


def main():
    directory, *names = sys.argv[1:]
    directory = pathlib.Path(directory).resolve()
    directory.mkdir(parents=True, exist_ok=True)
    os.environ["GLASSWING_CONFIG"] = "/dev/null"
    for name, (file, finer, exact, words, behind) in all_cases(directory).items():
        if names and name not in names:
            continue
        case = {"settings": {"rays": str(file), "exact_depth": exact}, "samples": max(1, SAMPLES // finer**2), "finer": finer,
                "output": str(directory / "render"), "error": str(directory / "error.txt"), **behind}
        (directory / "cases.json").write_text(json.dumps([case]))
        run("env", f"HOME={directory}", "blender", "-b", "--factory-startup", "--python-exit-code", 1, "-P",
            ROOT / "tests/compositing/hosts/blender/card_cases.py", "--", ADDON, directory / "cases.json")
        run(BIN / "glasswing", "composite", file, *words, "--exact", "-o", directory / "expected.exr")
        rays, expected = glasswing.Rays.read(file), glasswing.read_picture(directory / "expected.exr")
        height, width = rays.coverage.shape
        render = np.fromfile(directory / "render", np.float32).reshape(height * finer, width * finer, 3)
        render, whole = averaged(render, rays, finer)
        where = whole & (rays.coverage > 0)
        error = (render - expected)[where]
        print(f"{name}: {-10 * np.log10(np.mean(error**2)):.1f} dB, {np.abs(error).max():.3f}", flush=True)
        row = np.hstack([expected, render, 5 * np.abs(render - expected) * whole[..., None]])
        glasswing.write_picture(directory / f"{name.translate(str.maketrans(' ', '-', ':,'))}.png", row.astype(np.float32))


if __name__ == "__main__":
    main()
