"""What glasswing dataset writes, read by others: NumPy, SciPy, h5py, COLMAP. The mattes are of a sphere of glass before two
monitors, in closed form (tests/client/python/glass_mattes.cpp)."""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy as np
import scipy.sparse

import glasswing

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "client/python"))
from rays_test import MATRIX, PITCH, camera_directions, monitor_points, through_sphere  # noqa: E402

BIN = pathlib.Path(os.environ["GLASSWING_BIN"])
WIDTH, HEIGHT = 40, 30
NAMES = ("near", "far")


def pose(angle: float, shift: tuple[float, float, float]) -> np.ndarray:
    """Object to camera: turned about y, then moved."""
    matrix = np.eye(4)
    matrix[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    matrix[:3, 3] = shift
    return matrix


# Of the two views; the sphere's middle is at (3, -2, 120) of the camera.
POSES = {"near": pose(0.3, (3.0, -2.0, 119.0)), "far": pose(-0.9, (2.0, -2.0, 121.0)),
         "bare": pose(1.2, (5.0, 1.0, 118.0))}


def moved(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def quaternion_matrix(w: float, x: float, y: float, z: float) -> np.ndarray:
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def screen_truth(depth: int) -> tuple[np.ndarray, np.ndarray]:
    """By Snell's law, for each pixel: where the ray through the sphere meets a monitor, camera's frame, HEIGHT x WIDTH x 3;
    and whether it passes the sphere and meets one."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    directions = camera_directions(np.column_stack([x.ravel(), y.ravel()]))
    with np.errstate(invalid="ignore"):
        leave, along = through_sphere(directions)
    points, met = np.zeros((len(directions), 3)), np.zeros(len(directions), bool)
    for monitor in range(2):
        corner, right, below = monitor_points(monitor, depth, np.array([[0.0, 0.0], [60.0, 0.0], [0.0, 90.0]]))
        axes = np.column_stack([(right - corner) / 60, (below - corner) / 90])
        normal = np.cross(axes[:, 0], axes[:, 1])
        distance = ((corner - leave) @ normal) / (along @ normal)
        at = leave + distance[:, None] * along
        pixels = (at - corner) @ axes / PITCH**2
        here = np.isfinite(distance) & (pixels > 0).all(axis=1) & (pixels < [60, 90]).all(axis=1)
        points[here], met[here] = at[here], True
    return points.reshape(HEIGHT, WIDTH, 3), met.reshape(HEIGHT, WIDTH)


class DatasetTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        directory = tempfile.TemporaryDirectory()
        cls.addClassCleanup(directory.cleanup)
        cls.directory = pathlib.Path(directory.name)
        subprocess.run([BIN / "glass-mattes", cls.directory], check=True)
        (cls.directory / "points").mkdir()
        subprocess.run([BIN / "glass-mattes", cls.directory / "points", "points"], check=True)
        rig = (cls.directory / "rig.txtpb").read_text()
        (cls.directory / "pinhole.txtpb").write_text(re.sub(r"\bk1: \S+", "", rig))
        (cls.directory / "poses.json").write_text(
            json.dumps({"unit": "mm", "object_to_rig": {name: POSES[name].tolist() for name in POSES}}))

    def command(self, *words: str) -> subprocess.CompletedProcess:
        command = [BIN / "glasswing-compositing", "dataset", *words]
        return subprocess.run(command, cwd=self.directory, capture_output=True, text=True, timeout=60)

    def made(self, format_name: str, *words: str, rig: str = "rig.txtpb", folder: str = ".") -> pathlib.Path:
        output = self.directory / self.id().rsplit(".", 1)[-1]
        done = self.command(f"{folder}/near.exr", f"{folder}/far.exr", "--format", format_name, "-o", str(output), "--geometry", rig,
                            "--object-poses", "poses.json", *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        return output

    def refused(self, *words: str) -> str:
        done = self.command(*words, "-o", "refused")
        self.assertEqual(done.returncode, 1, done.stdout)
        return done.stderr

    def test_transport_times_a_picture_is_the_exact_composite(self):
        output = self.directory / "transport"
        done = self.command("near.exr", "--format", "transport", "-o", "transport")
        self.assertEqual(done.returncode, 0, done.stderr)
        matte = glasswing.Matte.read(self.directory / "near.exr")
        random = np.random.default_rng(1)
        pictures = {name: random.uniform(0, 1, (90, 60, 3)).astype(np.float32) for name in matte.monitors}
        exact = matte.composite(pictures, exact=True)
        foreground = np.load(output / "near/foreground.npy")
        about = json.loads((output / "near/transport.json").read_text())
        self.assertEqual([monitor["first_column"] for monitor in about["monitors"]], [0, 60 * 90])
        for channel, letter in enumerate("rgb"):
            matrix = scipy.sparse.load_npz(output / f"near/{letter}.npz")
            self.assertEqual(matrix.shape, (WIDTH * HEIGHT, 2 * 60 * 90))
            shown = np.concatenate([pictures[name][:, :, channel].ravel() for name in matte.monitors])
            seen = (matrix @ shown).reshape(HEIGHT, WIDTH) + foreground[:, :, channel]
            psnr = -10 * np.log10(np.mean((seen - exact[:, :, channel]) ** 2))
            self.assertGreater(psnr, 90.0)
            own = matte.transport(letter)
            self.assertEqual((own.matrix != matrix).nnz, 0)
            self.assertEqual(own.first_columns, {"left": 0, "right": 60 * 90})

    def test_the_transpose_is_the_picture_from_a_monitor(self):
        matte = glasswing.Matte.read(self.directory / "near.exr")
        light = np.random.default_rng(2).uniform(0, 1, (HEIGHT, WIDTH, 3)).astype(np.float32)
        seen = matte.from_monitor("right", light=light)
        scale = 60 * 90 / (WIDTH * HEIGHT)
        for channel, letter in enumerate("rgb"):
            transposed = matte.transport(letter).matrix.T @ light[:, :, channel].ravel()
            expected = scale * transposed[60 * 90:].reshape(90, 60)
            self.assertGreater(expected.max(), 0.01)
            np.testing.assert_allclose(seen[:, :, channel], expected, atol=1e-4 * expected.max())
        output = self.directory / "from.exr"
        command = [BIN / "glasswing-compositing", "composite", "near.exr", "--from", "right", "-o", output]
        subprocess.run(command, cwd=self.directory, check=True, capture_output=True)
        np.testing.assert_allclose(glasswing.read_picture(output), matte.from_monitor("right"), rtol=1e-5, atol=1e-6)
        for words, said in ((("--from", "nowhere"), "--from is nowhere; it must be monitor, which is the first one, or one of: left, right"),
                            (("--from", "left", "--error", "e.exr"), "--error does not go with --from")):
            done = subprocess.run([*command[:3], *words, "-o", output], cwd=self.directory, capture_output=True, text=True)
            self.assertEqual(done.returncode, 1)
            self.assertIn(said, done.stderr)

    def test_neto_has_the_points_of_snells_law(self):
        # The ball's map bends; of points the mean is where the middle's ray lands.
        output = self.made("neto", rig="pinhole.txtpb", folder="points")
        points, sd = np.load(output / "screen_point.npy"), np.load(output / "screen_point_sd.npy")
        self.assertEqual((points.shape, sd.shape), ((2, HEIGHT, WIDTH, 3), (2, HEIGHT, WIDTH)))
        for view, name in enumerate(NAMES):
            lit = glasswing.read_picture(output / f"light_mask/{view:03}.png")[:, :, 0] > 0.5
            truth, met = screen_truth(view)
            self.assertGreater(lit.sum(), 100)
            self.assertTrue(met[lit].all())
            at = moved(POSES[name], points[view][lit])
            # The matte holds floats.
            np.testing.assert_allclose(at, truth[lit], atol=2e-4)
            # Not less than those of the fit.
            self.assertGreater(sd[view][lit].min(), PITCH * (0.02, 0.05)[view] * (1 - 1e-3))
            self.assertFalse(points[view][~lit].any())
            mask = glasswing.read_picture(output / f"mask/{view:03}.png")[:, :, 0] > 0.5
            self.assertTrue(mask[lit].all())

    def test_neto_resamples_what_a_lens_distorts(self):
        output = self.made("neto", folder="points")
        points = np.load(output / "screen_point.npy")
        y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
        lit = glasswing.read_picture(output / "light_mask/000.png")[:, :, 0] > 0.5
        self.assertGreater(lit.sum(), 60)
        slopes = (np.column_stack([x[lit], y[lit]]) - MATRIX[:2, 2]) / np.diag(MATRIX)[:2]
        directions = np.column_stack([slopes, np.ones(len(slopes))])
        leave, along = through_sphere(directions / np.linalg.norm(directions, axis=1, keepdims=True))
        at = moved(POSES["near"], points[0][lit])
        off = np.linalg.norm(np.cross(at - leave, along), axis=1)
        # Linear between pixels, over which the sphere's picture turns: the nearest pixel's points would be off by more.
        self.assertLess(np.median(off), 0.1 * PITCH)

    def test_cameras_project_the_object_into_its_mask(self):
        output = self.made("idr", rig="pinhole.txtpb")
        cameras = np.load(output / "cameras.npz")
        self.assertEqual(sorted(cameras.files), ["scale_mat_0", "scale_mat_1", "world_mat_0", "world_mat_1"])
        point, farthest = np.array([0.4, 0.3, 1.1]), []
        for view, name in enumerate(NAMES):
            world, scale = cameras[f"world_mat_{view}"], cameras[f"scale_mat_{view}"]
            seen = MATRIX @ moved(POSES[name], point)
            projected = world @ np.append(point, 1.0)
            # Centres of pixels are at whole numbers here.
            np.testing.assert_allclose(projected[:2] / projected[2], seen[:2] / seen[2] - 0.5, atol=1e-9)
            # All rays of the mask pass the sphere, and a tenth of it more would be too large.
            mask = glasswing.read_picture(output / f"mask/{view:03}.png")[:, :, 0] > 0.5
            y, x = np.nonzero(mask)
            rays = (np.column_stack([x, y]) + 0.5 - MATRIX[:2, 2]) / np.diag(MATRIX)[:2]
            rays = np.column_stack([rays, np.ones(len(rays))])
            middle = moved(POSES[name], scale[:3, 3])
            off = np.linalg.norm(np.cross(rays / np.linalg.norm(rays, axis=1, keepdims=True), middle), axis=1)
            farthest.append(off.max() / scale[0, 0])
            self.assertLess(farthest[-1], 1.0)
            image = glasswing.read_picture(output / f"image/{view:03}.png")
            self.assertEqual(image.shape, (HEIGHT, WIDTH, 3))
        self.assertGreater(max(farthest), 0.9)

    def test_transforms_have_the_axes_of_opengl(self):
        output = self.made("transforms")
        made = json.loads((output / "transforms.json").read_text())
        self.assertEqual((made["w"], made["h"], made["fl_x"], made["cx"]), (WIDTH, HEIGHT, 60.0, 19.0))
        self.assertAlmostEqual(made["k1"], -0.08)
        point = np.array([0.4, 0.3, 1.1, 1.0])
        for frame, name in zip(made["frames"], NAMES):
            x, y, z, _ = np.linalg.inv(frame["transform_matrix"]) @ point
            self.assertLess(z, 0.0)
            seen = MATRIX @ moved(POSES[name], point[:3])
            np.testing.assert_allclose([frame["fl_x"] * x / -z + frame["cx"], frame["fl_y"] * y / z + frame["cy"]],
                                       seen[:2] / seen[2], atol=1e-9)
            self.assertTrue((output / frame["file_path"]).is_file())

    def test_colmap_opens_the_model(self):
        output = self.directory / "colmap"
        done = self.command("near.exr", "bare.exr", "--geometry", "rig.txtpb", "--poses", "near", "--object-poses", "poses.json",
                            "--format", "colmap", "-o", "colmap")
        self.assertEqual(done.returncode, 0, done.stderr)
        model = output / "sparse/0"
        cameras = [line.split() for line in (model / "cameras.txt").read_text().splitlines() if not line.startswith("#")]
        self.assertEqual(len(cameras), 1)
        self.assertEqual(cameras[0][1:4], ["FULL_OPENCV", "40", "30"])
        fx, fy, cx, cy, k1, *_ = map(float, cameras[0][4:])
        points = {}
        for line in (model / "points3D.txt").read_text().splitlines():
            if not line.startswith("#"):
                words = line.split()
                points[int(words[0])] = np.array(words[1:4], float)
        lines = [line for line in (model / "images.txt").read_text().splitlines() if not line.startswith("#")]
        worst, compared = 0.0, 0
        for head, row in zip(lines[::2], lines[1::2]):
            _, *numbers, camera, name = head.split()
            turn, shift = quaternion_matrix(*map(float, numbers[:4])), np.array(numbers[4:7], float)
            self.assertEqual(camera, "1")
            np.testing.assert_allclose(turn, POSES[name.removesuffix(".png")][:3, :3], atol=1e-9)
            for x, y, point in np.array(row.split(), float).reshape(-1, 3):
                u, v, depth = turn @ points[int(point)] + shift
                u, v = u / depth, v / depth
                radial = 1 + k1 * (u * u + v * v)
                worst = max(worst, np.hypot(fx * u * radial + cx - x, fy * v * radial + cy - y))
                compared += 1
        self.assertGreater(compared, 100)
        self.assertLess(worst, 1e-3)
        done = subprocess.run(["colmap", "model_analyzer", "--path", str(model)], capture_output=True, text=True, timeout=60,
                              env=dict(os.environ, QT_QPA_PLATFORM="offscreen"))
        said = done.stdout + done.stderr
        self.assertEqual(done.returncode, 0, said)
        found = re.search(r"Mean reprojection error: ([\d.e-]+)px", said)
        self.assertIsNotNone(found, said)
        self.assertLess(float(found[1]), 0.1)
        self.assertRegex(said, r"Registered images: 2\b")
        self.assertRegex(said, rf"Points: {len(points)}\b")

    def test_views_of_several_cameras_have_their_own_calibrations(self):
        rig = (self.directory / "pinhole.txtpb").read_text()
        (self.directory / "wide.txtpb").write_text(re.sub(r"fx_px: \S+", "fx_px: 50", rig, count=1))
        for name in NAMES:
            (self.directory / f"{name}.json").write_text(json.dumps({"object_to_rig": {f"vase.{name}": POSES[name].tolist()}}))
        views = ("points/vase.near.exr", "points/vase.far.exr")
        options = ("--geometry", "near=pinhole.txtpb,far=wide.txtpb", "--poses", "near,far", "--format", "colmap", "-o", "cameras")
        done = self.command(*views, *options, "--object-poses", "far=far.json,near=near.json")
        self.assertEqual(done.returncode, 0, done.stderr)
        model = self.directory / "cameras/sparse/0"
        cameras = dict(re.findall(r"^(\d+) PINHOLE 40 30 (\S+)", (model / "cameras.txt").read_text(), re.MULTILINE))
        images = re.findall(r"^\d+ ([-\d.e ]+) (\d+) vase\.(near|far)\.png$", (model / "images.txt").read_text(), re.MULTILINE)
        self.assertEqual([(name, float(cameras[camera])) for _, camera, name in images], [("near", 60.0), ("far", 50.0)])
        for numbers, _, name in images:
            np.testing.assert_allclose(np.array(numbers.split()[4:], float), POSES[name][:3, 3])
        self.assertEqual(json.loads((self.directory / "cameras/views.json").read_text()),
                         [{"name": "vase.near", "camera": "near"}, {"name": "vase.far", "camera": "far"}])
        for pose_files, said in (("near=near.json", "is given for the cameras near, but session vase.far has another one"),
                                 ("near=near.json,far.json", "--object-poses names a camera for some files"),
                                 ("near.json,far.json", "--object-poses has several files")):
            done = self.command(*views, *options, "--object-poses", pose_files)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertIn(said, done.stderr)

    def test_wrong_input_is_named(self):
        posed = ("--geometry", "rig.txtpb", "--object-poses", "poses.json")
        self.assertIn("--geometry is required for idr", self.refused("near.exr", "--format", "idr"))
        self.assertIn("--object-poses is required for neto",
                      self.refused("near.exr", "--format", "neto", "--geometry", "rig.txtpb"))
        self.assertIn("as another one is", self.refused("near.exr", "near.exr", "--format", "idr", *posed))
        self.assertIn('no pose "nowhere"', self.refused("near.exr", "--format", "idr", *posed, "--poses", "nowhere"))
        self.assertIn("2 monitors; SOFAST has one screen", self.refused("near.exr", "--format", "sofast", *posed))
        self.assertIn("there are 1", self.refused("near.exr", "--format", "idr", *posed, "--poses", "near,far"))
        for text, said in (("[]", "it must be JSON"), ('{"object_to_rig": {"near": [1]}}', 'pose "near" is not of four rows'),
                           ('{"object_to_rig": {"other": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}', "no pose of near"),
                           ('{"object_to_rig": {"near": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}', "is not a rotation")):
            (self.directory / "bad.json").write_text(text)
            self.assertIn(said, self.refused("near.exr", "--format", "idr", "--geometry", "rig.txtpb", "--object-poses", "bad.json"))


if __name__ == "__main__":
    unittest.main()
