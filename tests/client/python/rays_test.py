"""Files of rays, against an independent reader of OpenEXR; correspondences through a sphere of glass, against Snell's law."""

import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np
from exr_reader import read_exr

import glasswing
from glasswing import Rays, RayState

BIN = pathlib.Path(os.environ["GLASSWING_BIN"])
AXES = ("x", "y", "z")
# As glass_mattes.cpp has them.
CENTRE, RADIUS, INDEX = np.array([3.0, -2.0, 120.0]), 20.0, 1.5
MATRIX, K1 = np.array([[60.0, 0.0, 19.0], [0.0, 61.0, 15.5], [0.0, 0.0, 1.0]]), -0.08
TURNS, SIDES, DEPTHS, PITCH = (-0.35, 0.35), (-26.0, 26.0), (200.0, 250.0), 0.8


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=1, keepdims=True)


def refracted(direction: np.ndarray, normal: np.ndarray, ratio: float) -> np.ndarray:
    """Snell's law with vectors: the part along the surface changes by `ratio`; the normal is on the light's side."""
    along = ratio * (direction - dot(direction, normal) * normal)
    return along - np.sqrt(1.0 - dot(along, along)) * normal


def through_sphere(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays from the camera leave the sphere, and along which directions: N x 3."""
    to = dot(direction, CENTRE)
    enter = (to - np.sqrt(to**2 - CENTRE @ CENTRE + RADIUS**2)) * direction
    inside = refracted(direction, (enter - CENTRE) / RADIUS, 1.0 / INDEX)
    leave = enter - 2.0 * dot(enter - CENTRE, inside) * inside
    return leave, refracted(inside, (CENTRE - leave) / RADIUS, INDEX)


def camera_directions(points: np.ndarray) -> np.ndarray:
    """Of points of the picture, N x 2."""
    distorted = (points - MATRIX[:2, 2]) / np.diag(MATRIX)[:2]
    slopes = distorted
    for _ in range(50):
        slopes = distorted / (1.0 + K1 * dot(slopes, slopes))
    directions = np.column_stack([slopes, np.ones(len(slopes))])
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def monitor_points(monitor: int, depth: int, pixels: np.ndarray) -> np.ndarray:
    """Of a monitor's pixels, N x 2: turned about x by 0.1, then about y, about the middle of 60 x 90 px; mm."""
    x, y = ((pixels - [30.0, 45.0]) * PITCH).T
    y, z = y * np.cos(0.1), y * np.sin(0.1)
    turn = TURNS[monitor]
    x, z = x * np.cos(turn) + z * np.sin(turn), z * np.cos(turn) - x * np.sin(turn)
    return np.column_stack([x + SIDES[monitor], y, z + DEPTHS[depth]])


def off_line(points: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(points - origins, directions), axis=1)


class RaysTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        directory = tempfile.TemporaryDirectory()
        cls.addClassCleanup(directory.cleanup)
        cls.directory = pathlib.Path(directory.name)
        subprocess.run([BIN / "glass-mattes", cls.directory], check=True)
        cls.path = cls.made("rays.exr", "near.exr", "far.exr")
        cls.rays = Rays.read(cls.path)

    @classmethod
    def made(cls, output: str, *words: str) -> pathlib.Path:
        command = [BIN / "glasswing", "rays", *words, "--geometry", "rig.txtpb", "-o", output]
        subprocess.run(command, check=True, cwd=cls.directory, stdout=subprocess.DEVNULL)
        return cls.directory / output

    def test_arrays_are_the_files(self):
        parts, rays = read_exr(self.path), self.rays
        count = rays.weight.shape[3]
        self.assertEqual(list(parts), ["preview", "foreground", "ray", *(f"ray{i + 1}" for i in range(count))])

        def of_rays(layer: str) -> np.ndarray:
            of_ray = [np.stack([parts[f"ray{i + 1}"][f"{layer}.{c}"] for c in "RGB"], axis=2) for i in range(count)]
            return np.stack(of_ray, axis=3)

        def of_axes(layer: str) -> np.ndarray:
            return np.stack([of_rays(f"{layer}_{axis}") for axis in AXES], axis=4)

        def of_bundle(layer: str) -> np.ndarray:
            return np.stack([of_axes(f"{layer}_{axis}") for axis in "uv"], axis=4)

        self.assertEqual(rays.weight.shape[:3], (30, 40, 3))
        for name, array in {
            "weight": of_rays("weight"),
            "origin_mm": of_axes("origin"),
            "direction": of_axes("direction"),
            "origin_spread_mm": of_bundle("origin"),
            "direction_spread": of_bundle("direction"),
            "origin_sd_mm": of_rays("origin_sd"),
            "direction_sd": of_rays("direction_sd"),
            "state": of_rays("state"),
            "foreground": np.stack([parts["foreground"][f"F.{c}"] for c in "RGB"], axis=2),
            "coverage": parts["foreground"]["coverage.Y"],
            "flags": parts["foreground"]["flags.Y"],
        }.items():
            with self.subTest(name):
                np.testing.assert_array_equal(getattr(rays, name), array)
                self.assertRaises(ValueError, getattr(rays, name).__setitem__, ..., 0)
        self.assertTrue(np.any(rays.state == RayState.MATCHED) and np.any(rays.state == RayState.STRAIGHT))

    def test_metadata_is_the_geometrys(self):
        rays = self.rays
        self.assertEqual((rays.poses, rays.monitors), (("near", "far"), ("left", "right")))
        np.testing.assert_array_equal(rays.camera_matrix, MATRIX)
        np.testing.assert_array_equal(rays.distortion, [K1, 0.0, 0.0, 0.0, 0.0])
        self.assertEqual([pose.name for pose in rays.geometry.monitors], ["near", "near", "far", "far"])
        self.assertIn("near, 40x30", repr(rays))

    def test_correspondences_obey_snells_law(self):
        found = self.rays.correspondences()
        self.assertGreater(len(found), 300)
        self.assertEqual(set(found.monitor), {0, 1})
        self.assertEqual(set(found.channel), {0, 1, 2})
        # Float32 rounds places of 90 px by 4e-6 px, points of 250 mm by 8e-6 mm on each axis, and directions by 6e-8,
        # over 60 mm or so.
        leave, out = through_sphere(camera_directions(found.pixel + 0.5))
        for points, pixels, depth in ((found.near_mm, found.near_px, 0), (found.far_mm, found.far_px, 1)):
            self.assertLess(off_line(points, leave, out).max(), 5e-5)
            for monitor in (0, 1):
                here = found.monitor == monitor
                np.testing.assert_allclose(monitor_points(monitor, depth, pixels[here]), points[here], rtol=0, atol=5e-5)
        self.assertTrue(np.all(dot(found.far_mm - found.near_mm, out) > 0.0))
        np.testing.assert_allclose(found.near_sd_mm, 0.02 * PITCH, rtol=1e-5)
        np.testing.assert_allclose(found.far_sd_mm, 0.05 * PITCH, rtol=1e-4)
        np.testing.assert_allclose(found.weight, 0.9 - 0.1 * found.channel, rtol=1e-6)
        x, y = found.pixel.T
        np.testing.assert_array_equal(self.rays.state[y, x, found.channel, found.ray], found.state)

    def test_correspondences_come_back_from_their_file(self):
        found = self.rays.correspondences()
        found.save(self.directory / "vase.npz")
        with np.load(self.directory / "vase.npz") as saved:
            self.assertEqual(set(saved), set(vars(found)))
            for name in saved:
                np.testing.assert_array_equal(saved[name], getattr(found, name))

    def test_rays_of_mattes_are_the_command_lines(self):
        near, far = (glasswing.Matte.read(self.directory / f"{name}.exr") for name in ("near", "far"))
        geometry = glasswing.read_geometry(self.directory / "rig.txtpb")
        self.assertEqual(geometry, self.rays.geometry)
        Rays.match(near, far, geometry).write(self.directory / "made.exr")
        self.assertEqual((self.directory / "made.exr").read_bytes(), self.path.read_bytes())
        swapped = self.made("swapped.exr", "near.exr", "far.exr", "--poses", "far,near")
        Rays.match(near, far, geometry, poses=("far", "near")).write(self.directory / "made.exr")
        self.assertEqual((self.directory / "made.exr").read_bytes(), swapped.read_bytes())
        one = self.made("one.exr", "near.exr", "--object-depth", "120")
        Rays.far_light(near, geometry, 120.0).write(self.directory / "made.exr")
        self.assertEqual((self.directory / "made.exr").read_bytes(), one.read_bytes())

    def test_composites_are_the_command_lines(self):
        rng = np.random.default_rng(3)
        shapes = (32, 64, 3), (90, 60, 3), (20, 30, 3)
        sky, near, far = (rng.random(shape).astype(np.float16).astype(np.float32) for shape in shapes)
        for name, picture in (("sky", sky), ("a", near), ("b", far)):
            glasswing.write_picture(self.directory / f"{name}.exr", picture)
        depth = self.rays.near_depth_mm
        for exact in (False, True):
            for words, given in {
                ("--environment", "sky.exr", "--environment-turn", "40"): {"environment": sky, "environment_turn_deg": 40.0},
                ("--environment", "sky.exr", "--lossless"): {"environment": sky, "lossless": True},
                ("--plane", "300:b.exr", "--background", "left=a.exr"): {"planes": [(300.0, far), (depth, near)]},
                ("--plane", "300:b.exr", "--environment", "sky.exr"): {"planes": [(300, far)], "environment": sky},
            }.items():
                with self.subTest(words=words, exact=exact):
                    made = [BIN / "glasswing", "composite", self.path.name, *words, "-o", "out.exr"]
                    subprocess.run(made + ["--exact"] * exact, check=True, cwd=self.directory, capture_output=True)
                    picture = self.rays.composite(**given, exact=exact)
                    [written] = read_exr(self.directory / "out.exr").values()
                    np.testing.assert_array_equal(picture, np.stack([written[c] for c in "RGB"], axis=2))
                    np.testing.assert_array_equal(picture, self.rays.composite(**given, exact=exact, threads=1))

    def test_composites_of_nothing_are_refused(self):
        grey = np.full((4, 4, 3), 0.5, np.float32)
        for given, words in (
            ({}, "planes or environment"),
            ({"planes": [(100.0, grey)], "lossless": True}, "lossless"),
            ({"planes": [(0.0, grey)]}, "depth 0.0 mm"),
            ({"planes": [(100.0, grey[..., 0])]}, r"plane 100 has the shape \(4, 4\)"),
            ({"environment": (255 * grey).astype(np.uint8)}, "environment is of type uint8"),
        ):
            with self.subTest(words), self.assertRaisesRegex(glasswing.InvalidInput, words):
                self.rays.composite(**given)

    def test_geometry_that_does_not_fit_is_refused(self):
        near, far = (glasswing.Matte.read(self.directory / f"{name}.exr") for name in ("near", "far"))
        geometry = glasswing.read_geometry(self.directory / "rig.txtpb")
        with self.assertRaisesRegex(glasswing.NotFound, 'no pose "mid"'):
            Rays.match(near, far, geometry, poses=("near", "mid"))
        with self.assertRaisesRegex(glasswing.InvalidInput, "above 0"):
            Rays.far_light(near, geometry, 0.0)
        del geometry.monitors[0].rotation[:]
        with self.assertRaisesRegex(glasswing.InvalidInput, "0 numbers of rotation"):
            Rays.match(near, far, geometry)
        with self.assertRaisesRegex(glasswing.NotFound, "none.txtpb"):
            glasswing.read_geometry(self.directory / "none.txtpb")

    def test_what_is_refused(self):
        one = Rays.read(self.made("one.exr", "near.exr", "--object-depth", "120"))
        self.assertEqual(one.poses, ("near",))
        with self.assertRaisesRegex(glasswing.Refused, "two depths"):
            one.correspondences()
        for name, error in (("none.exr", glasswing.NotFound), ("near.exr", glasswing.Damaged)):
            with self.assertRaisesRegex(error, name):
                Rays.read(self.directory / name)
        self.assertRaises(glasswing.Damaged, Rays.from_bytes, self.path.read_bytes()[:-1])

    def test_arrays_outlive_the_rays(self):
        weight = Rays.from_bytes(self.path.read_bytes()).weight
        np.testing.assert_array_equal(weight, self.rays.weight)


if __name__ == "__main__":
    unittest.main()
