#!/usr/bin/env python3
"""Makes a data set of a cut crystal on a turntable, for others' solvers: captures it on simulated devices from all sides,
exports it in every format of glasswing dataset, and writes its true surface, normals and correspondences. Needs SciPy.
With --object ball it is one of a ball of glass, beside which lies a sheet of glass.

    export PYTHONPATH=$PWD/build/release/python PATH=$PWD/build/release/bin:$PATH
    client/python/examples/glass_dataset.py out/crystal
    client/python/examples/glass_score.py out/crystal

Each camera is one focal length, which sets how far it stands from the crystal: two are two cameras that saw the same poses.
The same command continues an interrupted series. DIRECTORY gets, for each camera a, b, ...:

    a/NAME.exr, a/rig.txtpb, a/poses.json    mattes, geometry, and where the object stood
    a/transport, a/neto, a/idr, ...          what solvers read; in idr/photographs frames before a natural background
    a/truth/NNN.npz                          of each pixel: where the ray of its middle enters and leaves the object, the
                                             surface's normals there (object's frame, mm), and the point on the monitor;
                                             valid: it leaves at the second surface, as do those of the pixel's corners, and
                                             has most of the pixel's light
    surface.ply                              the object, in its frame, mm
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import pathlib
import re
import subprocess
import sys
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

import glasswing

ROOT = pathlib.Path(__file__).resolve().parents[3]
FORMATS = ("transport", "neto", "idr", "transforms", "colmap", "sofast")
SERIES = "crystal"
PHOTOGRAPH = ROOT / "deploy/pictures/harbour.png"  # a natural background

Doubles = npt.NDArray[np.float64]


class Crystal:
    """The simulated scene "crystal" before a monitor of width x height mm, as planes normal . p = distance about its middle:
    the directions of an icosahedron's faces and corners (core/sim/scene.cpp)."""

    scene, index = "crystal", 1.518  # of green
    depth = 0.32  # of the table's axis before the monitor, in the monitor's widths

    def __init__(self, width: float, height: float) -> None:
        golden, radius = (1 + 5**0.5) / 2, 0.325 * min(width, height)
        normals, distances = [], []
        for a, b in itertools.product((-1, 1), repeat=2):
            for cut, inner, outer in ((1.03, a, b * golden), (1.0, a / golden, b * golden)):
                normals += [(0, inner, outer), (inner, outer, 0), (outer, 0, inner)]
                distances += [cut * radius] * 3
            normals += [(a, b, c) for c in (-1, 1)]
            distances += [radius] * 2
        turn_x, turn_y = 0.55, 0.90
        about_x = np.array([[1, 0, 0], [0, np.cos(turn_x), -np.sin(turn_x)], [0, np.sin(turn_x), np.cos(turn_x)]])
        about_y = np.array([[np.cos(turn_y), 0, np.sin(turn_y)], [0, 1, 0], [-np.sin(turn_y), 0, np.cos(turn_y)]])
        directions = np.array(normals, float)
        self.normals: Doubles = directions / np.linalg.norm(directions, axis=1, keepdims=True) @ (about_y @ about_x).T
        self.distances: Doubles = np.array(distances)

    def enter(self, origins: Doubles, directions: Doubles) -> tuple[Doubles, npt.NDArray[np.intp]]:
        """How far along rays the crystal begins, and at which plane; -1: they miss it."""
        speed, room = directions @ self.normals.T, self.distances - origins @ self.normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            at = room / speed
        into = np.where(speed < 0, at, -np.inf)
        plane = into.argmax(axis=1)
        near, far = into.max(axis=1), np.where(speed > 0, at, np.inf).min(axis=1)
        return near, np.where(near < far, plane, -1)

    def leave(self, origins: Doubles, directions: Doubles) -> tuple[Doubles, npt.NDArray[np.intp]]:
        """The same from inside."""
        speed, room = directions @ self.normals.T, self.distances - origins @ self.normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            at = np.where(speed > 1e-12, room / speed, np.inf)
        return at.min(axis=1), at.argmin(axis=1)

    def normal(self, _: Doubles, planes: npt.NDArray[np.intp]) -> Doubles:
        return self.normals[planes]

    def write(self, path: pathlib.Path) -> None:
        """As a PLY file of triangles."""
        corners: list[Doubles] = []
        for three in itertools.combinations(range(len(self.normals)), 3):
            planes = self.normals[list(three)]
            if abs(np.linalg.det(planes)) < 1e-6:
                continue
            corner = np.linalg.solve(planes, self.distances[list(three)])
            if (self.normals @ corner <= self.distances + 1e-9).all() and not any(np.allclose(corner, c) for c in corners):
                corners.append(corner)
        points, faces = np.array(corners), []
        for normal, distance in zip(self.normals, self.distances):
            on = np.flatnonzero(np.abs(points @ normal - distance) < 1e-6)
            if len(on) < 3:
                continue
            middle = points[on].mean(axis=0)
            spokes = points[on] - middle
            ring = on[np.arctan2(spokes @ np.cross(normal, spokes[0]), spokes @ spokes[0]).argsort()]
            faces += [(ring[0], ring[i], ring[i + 1]) for i in range(1, len(ring) - 1)]
        write_ply(path, points, faces)


class Ball:
    """That of the simulated scene "glass", as Crystal."""

    scene, index = "glass", 1.5
    depth = 0.5

    def __init__(self, width: float, height: float) -> None:
        self.centre: Doubles = np.array([-0.16 * width, -0.10 * height, -0.10 * width])
        self.radius = 0.26 * height

    def enter(self, origins: Doubles, directions: Doubles) -> tuple[Doubles, npt.NDArray[np.intp]]:
        near, _, hit = self._meet(origins, directions)
        return near, np.where(hit, 0, -1)

    def leave(self, origins: Doubles, directions: Doubles) -> tuple[Doubles, npt.NDArray[np.intp]]:
        return self._meet(origins, directions)[1], np.zeros(len(origins), np.intp)

    def _meet(self, origins: Doubles, directions: Doubles) -> tuple[Doubles, Doubles, npt.NDArray[np.bool_]]:
        away = origins - self.centre
        along = np.sum(away * directions, axis=1)
        root = along**2 - np.sum(away**2, axis=1) + self.radius**2
        half = np.sqrt(np.maximum(root, 0.0))
        return -along - half, -along + half, root > 0

    def normal(self, points: Doubles, _: npt.NDArray[np.intp]) -> Doubles:
        return (points - self.centre) / self.radius

    def write(self, path: pathlib.Path) -> None:
        rings, around = 90, 180
        down, turn = np.mgrid[0:rings + 1, 0:around] * np.pi / [[[rings]], [[around / 2]]]
        ball = np.stack([np.sin(down) * np.cos(turn), np.cos(down), np.sin(down) * np.sin(turn)], axis=2).reshape(-1, 3)
        faces = []
        for ring, step in itertools.product(range(rings), range(around)):
            a, b = around * ring + step, around * ring + (step + 1) % around
            faces += [(a, b, a + around), (b, b + around, a + around)]
        write_ply(path, self.centre + self.radius * ball, faces)


OBJECTS: dict[str, type[Crystal] | type[Ball]] = {"crystal": Crystal, "ball": Ball}
Body = Crystal | Ball


def write_ply(path: pathlib.Path, points: Doubles, faces: Sequence[tuple[int, int, int]]) -> None:
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}", *(f"property double {axis}" for axis in "xyz"),
            f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(map(repr, map(float, point))) for point in points] + [f"3 {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join([*head, *rows]) + "\n")


def refracted(direction: Doubles, normal: Doubles, ratio: float) -> tuple[Doubles, Doubles]:
    """Snell's law: the direction beyond a surface, NaN at total reflection, and the light that passes (Fresnel). The normal
    is on the light's side; `ratio` is the index here through that beyond."""
    cosine = -np.sum(direction * normal, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        beyond = np.sqrt(1 - ratio**2 * (1 - cosine**2))
    across = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    along = (ratio * beyond - cosine) / (ratio * beyond + cosine)
    return ratio * direction + (ratio * cosine - beyond) * normal, 1 - (across**2 + along**2)[:, 0] / 2


class Camera:
    """Of a simulated rig (docs/simulation.md), whose monitor fills the picture."""

    def __init__(self, focal_px: float, monitor: Sequence[int], pitch: float, picture: Sequence[int], depth: float) -> None:
        self.focal_px, self.monitor_px, self.pitch = focal_px, monitor, pitch
        self.width, self.height = picture
        self.monitor_width, self.monitor_height = (pitch * side for side in monitor)  # mm
        self.focal_y_px = focal_px * self.height * self.monitor_width / (self.width * self.monitor_height)
        self.distance = focal_px * self.monitor_width / self.width
        self.middle: Doubles = np.array([0.0, 0.0, self.distance - depth * self.monitor_width])  # of the table

    def geometry(self) -> str:
        """The file of "glasswing calibrate geometry"."""
        return (f"camera {{ width_px: {self.width} height_px: {self.height} fx_px: {self.focal_px!r} fy_px: {self.focal_y_px!r}"
                f" cx_px: {self.width / 2} cy_px: {self.height / 2} }}\n"
                f'monitors {{ name: "back" width_px: {self.monitor_px[0]} height_px: {self.monitor_px[1]}'
                f" pitch_mm: {self.pitch!r}\n"
                f"  rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n  translation_mm: [{-self.monitor_width / 2},"
                f" {-self.monitor_height / 2}, {self.distance!r}] }}\n")

    def pose(self, degrees: float) -> Doubles:
        """From the object's frame, whose origin is on the table's axis, to the camera's."""
        turn = np.radians(degrees)
        matrix = np.eye(4)
        matrix[:3, :3] = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
        matrix[:3, 3] = self.middle
        return matrix

    def truth(self, body: Body, degrees: float) -> dict[str, npt.NDArray[np.generic]]:
        """Of each pixel, as this script's help says."""
        pose = self.pose(degrees)
        y, x = np.mgrid[0:self.height, 0:self.width]
        planes = []
        for across, down in ((0.5, 0.5), (0, 0), (1, 0), (0, 1), (1, 1)):
            slopes = np.stack([(x + across - self.width / 2) / self.focal_px, (y + down - self.height / 2) / self.focal_y_px,
                               np.ones(x.shape)], axis=2).reshape(-1, 3)
            directions = slopes / np.linalg.norm(slopes, axis=1, keepdims=True) @ pose[:3, :3]
            origins = np.broadcast_to(-pose[:3, 3] @ pose[:3, :3], directions.shape)
            near, first = body.enter(origins, directions)
            enter = origins + near[:, None] * directions
            inside, passed = refracted(directions, body.normal(enter, first), 1 / body.index)
            depth, second = body.leave(enter + 1e-9 * inside, inside)
            out = enter + depth[:, None] * inside
            beyond, left = refracted(inside, -body.normal(out, second), body.index)
            planes.append((first, second))
            if (across, down) == (0.5, 0.5):
                middle = enter, first, out, second, beyond, passed * left
        enter, first, out, second, beyond, light = middle
        seen = out @ pose[:3, :3].T + pose[:3, 3]
        ahead = beyond @ pose[:3, :3].T
        with np.errstate(invalid="ignore", divide="ignore"):
            screen = seen + ((self.distance - seen[:, 2]) / ahead[:, 2])[:, None] * ahead
            inside_monitor = (np.abs(screen[:, :2]) < [self.monitor_width / 2, self.monitor_height / 2]).all(axis=1)
        one_facet = np.all([(own[0] == first) & (own[1] == second) for own in planes], axis=0)
        valid = (first >= 0) & one_facet & np.isfinite(beyond).all(axis=1) & inside_monitor & (ahead[:, 2] > 0) & (light > 0.5)
        hit = first >= 0
        shape = (self.height, self.width, 3)

        def picture(values: Doubles, where: npt.NDArray[np.bool_]) -> npt.NDArray[np.float32]:
            return np.where(where[:, None], values, 0.0).astype(np.float32).reshape(shape)

        return {"enter_mm": picture(enter, hit), "enter_normal": picture(body.normal(enter, first), hit),
                "leave_mm": picture(out, valid), "leave_normal": picture(body.normal(out, second), valid),
                "screen_mm": picture((screen - pose[:3, 3]) @ pose[:3, :3], valid),
                "hit": hit.reshape(shape[:2]), "valid": valid.reshape(shape[:2])}


def run(command: Sequence[str | pathlib.Path], **environment: str) -> None:
    subprocess.run(list(map(str, command)), check=True, env=dict(os.environ, **environment), stdout=subprocess.DEVNULL)


def capture(camera: Camera, body: Body, arguments: argparse.Namespace, degrees: list[float], directory: pathlib.Path) -> None:
    """Captures and solves all poses on a rig of this camera, and fetches the mattes."""
    port = str(arguments.port)
    rig = [ROOT / "deploy/local-rig", "up", "--data", directory / "rig", "--port", port, "--noise", arguments.noise,
           "--size", "{}x{}".format(*camera.monitor_px), "--camera-size", f"{camera.width}x{camera.height}",
           "--focal-length", camera.focal_px, "--scene", body.scene,
           "--camera-options", f"--axis=turn=0:360,--ray-areas,--blur={arguments.blur}", *arguments.rig]
    run(rig)
    server = {"GLASSWING_SERVER": f"127.0.0.1:{port}"}
    plan = arguments.plan or directory / "plan.txtpb"
    if not arguments.plan:
        run(["glasswing", "plan", "design", "--images", "50", "--noise", arguments.noise, "--monitor",
             "back:{}x{}".format(*camera.monitor_px), "-o", plan])
        # Bars of one pixel locate the stage beside the crystal.
        levels = min(camera.monitor_px).bit_length()
        text = re.sub("square_waves .*", f"square_waves {{ levels: {levels} }}", plan.read_text())
        plan.write_text(f'{text}photos {{ file: "{PHOTOGRAPH}" }}\n')
    try:
        run(["glasswing", "capture", plan, "--turn", ",".join(f"{degree:g}" for degree in degrees), "--session",
             SERIES, "--solve"], **server)
        with glasswing.connect(server["GLASSWING_SERVER"]) as connected:
            names = sorted(session.name for session in connected.sessions(tags=[SERIES]))
            for name in names:
                connected.session(name).download(directory / f"{name}.exr")
    finally:
        run([ROOT / "deploy/local-rig", "down", "--data", directory / "rig"])


def export(camera: Camera, directory: pathlib.Path, body: Body, degrees: list[float]) -> None:
    mattes = sorted(directory.glob(f"{SERIES}-*.exr"))
    if len(mattes) != len(degrees):
        raise glasswing.InvalidInput(f"{directory} has {len(mattes)} mattes of {SERIES}, but there are {len(degrees)} poses")
    (directory / "rig.txtpb").write_text(camera.geometry())
    poses = {matte.stem: camera.pose(degree).tolist() for matte, degree in zip(mattes, degrees)}
    (directory / "poses.json").write_text(json.dumps({"unit": "mm", "object_to_rig": poses}))
    for name in FORMATS:
        archives: list[str | pathlib.Path] = ["--archives", directory / "rig/camera/archives"]
        photographs = archives if name == "idr" else []
        run(["glasswing", "dataset", *mattes, "--geometry", directory / "rig.txtpb", "--object-poses", directory / "poses.json",
             "--background", PHOTOGRAPH, "--format", name, "-o", directory / name, *photographs])
    (directory / "truth").mkdir(exist_ok=True)
    for number, degree in enumerate(degrees):
        np.savez_compressed(directory / f"truth/{number:03}.npz", **camera.truth(body, degree))


def make(arguments: argparse.Namespace) -> None:
    degrees = [360.0 * number / arguments.views for number in range(arguments.views)]
    directory = pathlib.Path(arguments.directory)
    body: Body = OBJECTS[arguments.object](*(arguments.pitch * side for side in arguments.size))
    for letter, focal_px in zip("abcdefgh", arguments.focal_lengths):
        camera = Camera(focal_px, arguments.size, arguments.pitch, arguments.camera_size, body.depth)
        own = directory / letter
        own.mkdir(parents=True, exist_ok=True)
        capture(camera, body, arguments, degrees, own)
        export(camera, own, body, degrees)
        print(f"{own}: {len(degrees)} views from {camera.distance:g} mm before the monitor", flush=True)
    body.write(directory / "surface.ply")


def size(text: str) -> tuple[int, int]:
    width, height = map(int, text.split("x"))
    return width, height


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", metavar="DIRECTORY", help="where the data set is made")
    parser.add_argument("--object", choices=OBJECTS, default="crystal", help="what turns (default: %(default)s)")
    parser.add_argument("--views", type=int, default=36, metavar="N", help="poses, evenly round (default: 36)")
    parser.add_argument("--focal-lengths", type=lambda text: list(map(float, text.split(","))), default=[480.0, 640.0],
                        metavar="PX,...", help="of each camera, px of its picture (default: 480,640)")
    parser.add_argument("--size", type=size, default=(256, 192), metavar="WxH", help="of the monitor, px (default: 256x192)")
    parser.add_argument("--pitch", type=float, default=0.25, metavar="MM", help="of its pixels (default: %(default)s)")
    parser.add_argument("--camera-size", type=size, default=(148, 111), metavar="WxH",
                        help="of the cameras' pictures (default: 148x111)")
    parser.add_argument("--plan", help="for each pose (default: 50 images, designed for the monitor and the noise)")
    parser.add_argument("--noise", default="0.001", help="of the camera, as a part of full scale (default: %(default)s)")
    parser.add_argument("--blur", type=float, default=0.5, metavar="PX", help="of the lens, sigma (default: %(default)s)")
    parser.add_argument("--port", type=int, default=7540, help="of the simulated rig's server (default: %(default)s)")
    parser.add_argument("--rig", action="append", default=[], metavar="OPTION", help="a further option of deploy/local-rig up")
    arguments = parser.parse_args()
    if not 2 <= arguments.views <= 360:
        parser.error(f"--views is {arguments.views}; it must be 2 to 360")
    if len(arguments.focal_lengths) > 8:
        parser.error(f"--focal-lengths has {len(arguments.focal_lengths)} cameras; 8 are the most")
    return arguments


if __name__ == "__main__":
    try:
        make(parse_arguments())
    except (glasswing.Error, OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"glass_dataset: {error}")
    except KeyboardInterrupt:
        sys.exit("\nglass_dataset: interrupted; the same command continues")
