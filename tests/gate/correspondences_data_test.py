#!/usr/bin/python3
"""Correspondences of a rendered sphere and wedge of glass (L_depth), as a user makes them: import, solve, rays, Python;
against the renderer's own rays, and the sphere's by Snell's law."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import glasswing

BIN = pathlib.Path(os.environ["GLASSWING_BIN"])
SCENE = pathlib.Path(os.environ.get("GLASSWING_DATA", "/nonexistent")) / "rendered/dev2/L_depth"
GREEN = 1
# Regressions, a little above what was measured (docs/correspondences.md): medians of distances, mm.
LIMITS = {"the renderer's": {"near": 0.13, "far": 0.195}, "Snell's": {"near": 0.2, "far": 0.12}}


def run(*words: object) -> None:
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL)


def geometry_text(truth: dict) -> str:
    camera = truth["camera"]
    numbers = " ".join(f"{ours}: {camera[theirs]}" for ours, theirs in
                       (("width_px", "width"), ("height_px", "height"), ("fx_px", "fx"), ("fy_px", "fy"),
                        ("cx_px", "cx"), ("cy_px", "cy"), ("k1", "k1")))  # fmt: skip
    text = f"camera {{ {numbers} }}\n"
    for name in ("near", "far"):
        plane, monitor = truth["planes"][name], truth["monitor"]
        rotation = [value for row in plane["R"] for value in row]
        text += f'monitors {{ name: "{name}" width_px: {monitor["width"]} height_px: {monitor["height"]} pitch_mm: 1 '
        text += f'rotation: {rotation} translation_mm: {plane["t"]} }}\n'
    return text


def correspondences(truth: dict, directory: pathlib.Path) -> glasswing.Correspondences:
    (directory / "rig.txtpb").write_text(geometry_text(truth))
    for name in ("near", "far"):
        run(BIN / "glasswing", "import", SCENE / name, "--archive", directory / name)
        run(BIN / "glasswing-solver", "solve", directory / name, directory / f"{name}.exr", "--method", "gaussian")
    mattes = [directory / f"{name}.exr" for name in ("near", "far")]
    words = ("--geometry", directory / "rig.txtpb", "--poses", "near,far", "-o", directory / "rays.exr")
    run(BIN / "glasswing", "rays", *mattes, *words)
    return glasswing.Rays.read(directory / "rays.exr").correspondences()


def at_depth(origins: np.ndarray, directions: np.ndarray, z: float) -> np.ndarray:
    """Of vectors along the last axis."""
    return origins + directions * ((z - origins[..., 2:]) / directions[..., 2:])


def snell_rays(truth: dict, pixel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the camera's rays leave the sphere, and their directions; NaN where they miss it."""
    camera, sphere = truth["camera"], truth["objects"][0]
    centre, radius, index = np.array(sphere["centre"]), sphere["radius"], sphere["ior"]
    distorted = (pixel + 0.5 - [camera["cx"], camera["cy"]]) / [camera["fx"], camera["fy"]]
    slopes = distorted
    for _ in range(50):
        slopes = distorted / (1.0 + camera["k1"] * np.sum(slopes**2, axis=1, keepdims=True))
    ray = np.column_stack([slopes, np.ones(len(slopes))])
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)

    def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.sum(a * b, axis=1, keepdims=True)

    def refracted(direction: np.ndarray, normal: np.ndarray, ratio: float) -> np.ndarray:
        along = ratio * (direction - dot(direction, normal) * normal)
        return along - np.sqrt(1.0 - dot(along, along)) * normal

    to = dot(ray, centre)
    with np.errstate(invalid="ignore"):
        enter = (to - np.sqrt(to**2 - centre @ centre + radius**2)) * ray
        inside = refracted(ray, (enter - centre) / radius, 1.0 / index)
        leave = enter - 2.0 * dot(enter - centre, inside) * inside
        return leave, refracted(inside, (centre - leave) / radius, index)


def main() -> int:
    if not SCENE.exists():
        print(f"no data at {SCENE}; set GLASSWING_DATA")
        return 77
    truth = json.loads((SCENE / "truth.json").read_text())
    with tempfile.TemporaryDirectory() as temporary:
        found = correspondences(truth, pathlib.Path(temporary))
    failures = []

    def check(name: str, value: float, limit: float) -> None:
        print(f"{name}: {value:.3g}, at most {limit}")
        if not value <= limit:
            failures.append(name)

    depths = {name: plane["t"][2] for name, plane in truth["planes"].items()}
    corner = np.array(truth["planes"]["near"]["t"][:2])
    points = {"near": (found.near_mm, found.near_px), "far": (found.far_mm, found.far_px)}
    for name, (at, px) in points.items():
        check(f"{name} points off the monitor's plane, mm", np.abs(at[:, 2] - depths[name]).max(), 1e-4)
        check(f"{name} points off their pixels, mm", np.abs(at[:, :2] - corner - px).max(), 1e-4)

    # The strongest ray of green in each pixel, against the renderer's strongest of the pixel's middle.
    best = (found.channel == GREEN) & (found.ray == 0) & (found.state == glasswing.RayState.MATCHED) & (found.weight > 0.5)
    pixel = found.pixel[best]
    true = np.load(SCENE / "true_rays.npz")["rays"][pixel[:, 1], pixel[:, 0], 0]
    laws = {
        "the renderer's": (true[:, :3], true[:, 3:6], true[:, 6] > 0.5),
        "Snell's": (*(law := snell_rays(truth, pixel)), np.isfinite(law[1][:, 0])),
    }
    for whose, (origins, directions, known) in laws.items():
        for name, (at, _) in points.items():
            expected = at_depth(origins[known], directions[known], depths[name])
            off = np.linalg.norm(at[best][known] - expected, axis=1)
            sd = np.median(getattr(found, f"{name}_sd_mm")[best][known])
            print(f"{len(off)} {name} points; nine of ten off {whose} by {np.quantile(off, 0.9):.3f} mm; standard error {sd:.3f} mm")
            check(f"{name} points off {whose}, median, mm", np.median(off), LIMITS[whose][name])
    if failures:
        print("missed:", ", ".join(failures))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
