#!/usr/bin/env python3
"""Scores what a solver made of the data set of glass_dataset.py, or without --mesh and --normals the data themselves.

    export PYTHONPATH=$PWD/build/release/python
    client/python/examples/glass_score.py out/crystal
    client/python/examples/glass_score.py out/crystal --mesh reconstructed.ply
    client/python/examples/glass_score.py out/crystal --camera a --normals normals

A mesh is a PLY file of triangles, in the object's frame, mm: accuracy is the distance from its surface to the true one,
completeness that from the true one to it. Normals are NNN.npy, height x width x 3, of the first surface in the object's
frame; NaN or 0 where there is none. Needs SciPy.
"""

from __future__ import annotations

import argparse
import pathlib
import struct
import sys

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]
TYPES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
         "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d"}


def read_ply(path: pathlib.Path) -> tuple[Doubles, npt.NDArray[np.int64]]:
    """Corners and triangles of an ASCII or little-endian PLY file."""
    content = path.read_bytes()
    head, _, body = content.partition(b"end_header\n")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    if not lines or lines[0] != ["ply"] or not body:
        raise ValueError(f"{path} is not a PLY file")
    form = next(line[1] for line in lines if line[0] == "format")
    if form not in ("ascii", "binary_little_endian"):
        raise ValueError(f"{path} is {form}; it must be ascii or binary_little_endian")
    words, offset = iter(body.split()) if form == "ascii" else iter(()), 0

    def number(kind: str) -> float:
        nonlocal offset
        if form == "ascii":
            return float(next(words))
        (value,) = struct.unpack_from("<" + TYPES[kind], body, offset)
        offset += struct.calcsize(TYPES[kind])
        return float(value)

    elements: list[tuple[str, int, list[list[str]]]] = []
    for line in lines:
        if line[0] == "element":
            elements.append((line[1], int(line[2]), []))
        if line[0] == "property":
            elements[-1][2].append(line[1:])
    corners, triangles = [], []
    for name, count, properties in elements:
        for _ in range(count):
            values: dict[str, float] = {}
            for own in properties:
                if own[0] != "list":
                    values[own[-1]] = number(own[0])
                    continue
                ring = [int(number(own[2])) for _ in range(int(number(own[1])))]
                if name == "face" and own[-1] in ("vertex_indices", "vertex_index"):
                    triangles += [(ring[0], ring[i], ring[i + 1]) for i in range(1, len(ring) - 1)]
            if name == "vertex":
                corners.append([values[axis] for axis in "xyz"])
    if not triangles:
        raise ValueError(f"{path} has no faces")
    return np.array(corners), np.array(triangles)


def sampled(corners: Doubles, triangles: npt.NDArray[np.int64], count: int) -> Doubles:
    """Points spread evenly over a surface."""
    random = np.random.default_rng(0)
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = random.choice(len(triangles), count, p=areas / areas.sum())
    u, v = random.uniform(size=(2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points: Doubles = a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]
    return points


def said(name: str, values: npt.NDArray[np.float64], unit: str) -> None:
    if len(values) == 0:
        print(f"{name}: none")
        return
    print(f"{name}: median {np.median(values):.4f} {unit}, nine of ten below {np.quantile(values, 0.9):.4f} {unit} "
          f"({len(values)})")


def coverage(ratio: Doubles) -> tuple[float, float]:
    """The fraction of errors below their stated one (of a normal distribution in two axes 0.63), and their rms through it
    (1)."""
    return float(np.mean(ratio < 1)), float(np.sqrt(np.mean(ratio**2)))


def score_data(camera: pathlib.Path) -> tuple[float, float]:
    """Correspondences against Snell's law, and their stated errors. Returns coverage()."""
    points, sd = np.load(camera / "neto/screen_point.npy"), np.load(camera / "neto/screen_point_sd.npy")
    off, ratio, found, all_valid = [], [], 0, 0
    for number, path in enumerate(sorted((camera / "truth").glob("*.npz"))):
        truth = np.load(path)
        lit = points[number].any(axis=2)
        both = lit & truth["valid"]
        distance = np.linalg.norm(points[number] - truth["screen_mm"], axis=2)[both]
        off.append(distance)
        stated = sd[number][both]
        ratio.append(distance[stated > 0] / (2**0.5 * stated[stated > 0]))
        found, all_valid = found + int(both.sum()), all_valid + int(truth["valid"].sum())
    said(f"camera {camera.name}: correspondences, off Snell's law", np.concatenate(off), "mm")
    within, rms = coverage(np.concatenate(ratio))
    print(f"camera {camera.name}: {100 * within:.1f} % within the stated error (63 % if it is normal), rms through it {rms:.2f}")
    print(f"camera {camera.name}: {100 * found / max(all_valid, 1):.1f} % of the {all_valid} pixels with one path have one")
    return within, rms


def score_normals(camera: pathlib.Path, directory: pathlib.Path) -> None:
    angles = []
    for path in sorted((camera / "truth").glob("*.npz")):
        truth, normals = np.load(path), np.load(directory / f"{path.stem}.npy").astype(float)
        length = np.linalg.norm(normals, axis=2)
        both = truth["hit"] & np.isfinite(length) & (length > 0)
        cosine = np.sum(normals[both] * truth["enter_normal"][both], axis=1) / length[both]
        angles.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    said("normals, off", np.concatenate(angles), "degrees")


def score_mesh(path: pathlib.Path, truth: pathlib.Path, count: int) -> None:
    from scipy.spatial import cKDTree

    made, true = (sampled(*read_ply(file), count) for file in (path, truth))
    said("accuracy", cKDTree(true).query(made)[0], "mm")
    said("completeness", cKDTree(made).query(true)[0], "mm")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", type=pathlib.Path, metavar="DIRECTORY", help="that of glass_dataset.py")
    parser.add_argument("--mesh", type=pathlib.Path, help="a reconstructed surface, PLY")
    parser.add_argument("--normals", type=pathlib.Path, help="a directory of normals NNN.npy as --camera sees them")
    parser.add_argument("--camera", help="a, b, ...: only this one (default: all)")
    parser.add_argument("--points", type=int, default=200000, help="points on each surface (default: %(default)s)")
    arguments = parser.parse_args()
    if arguments.normals and not arguments.camera:
        parser.error("--normals needs --camera: whose pixels they are")
    if arguments.mesh:
        score_mesh(arguments.mesh, arguments.directory / "surface.ply", arguments.points)
    if arguments.normals:
        score_normals(arguments.directory / arguments.camera, arguments.normals)
    if arguments.mesh or arguments.normals:
        return
    for camera in sorted(path.parent for path in arguments.directory.glob("*/truth")):
        if arguments.camera in (None, camera.name):
            score_data(camera)


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"glass_score: {error}")
