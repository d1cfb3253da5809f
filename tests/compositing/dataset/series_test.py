"""The benchmark of the examples, made on a simulated turntable: its correspondences against Snell's law, COLMAP's points,
fringes for SOFAST decoded as SOFAST does, and the picture from the monitor against the simulator's own."""

import contextlib
import io
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy as np

import glasswing

ROOT = pathlib.Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "client/python/examples"
BIN = pathlib.Path(os.environ["GLASSWING_BIN"])
sys.path.insert(0, str(ROOT / "tests/processes"))
sys.path.insert(0, str(EXAMPLES))
import glass_score  # noqa: E402
from daemon import free_port  # noqa: E402

MONITOR, CAMERA, FOCAL_PX = (192, 144), (116, 87), 360.0


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((np.asarray(one, float) - other) ** 2)))


class SeriesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        directory = tempfile.TemporaryDirectory()
        cls.addClassCleanup(directory.cleanup)
        cls.directory = pathlib.Path(directory.name)
        environment = dict(os.environ, PATH=f"{BIN}:{os.environ['PATH']}")
        command = [sys.executable, EXAMPLES / "glass_dataset.py", cls.directory, "--views", "2", "--focal-lengths", f"{FOCAL_PX}",
                   "--size", "{}x{}".format(*MONITOR),
                   "--camera-size", "{}x{}".format(*CAMERA), "--port", str(free_port(3)), "--rig=--solvers", "--rig=1"]
        done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=500)
        if done.returncode:
            raise AssertionError(done.stdout)
        cls.camera = cls.directory / "a"

    def test_correspondences_are_those_of_snells_law(self):
        with contextlib.redirect_stdout(io.StringIO()) as said:
            within, rms = glass_score.score_data(self.camera)
        off = re.search(r"off Snell's law: median ([\d.]+) mm, .*\((\d+)\)", said.getvalue())
        self.assertIsNotNone(off, said.getvalue())
        self.assertGreater(int(off[2]), 500)
        self.assertLess(float(off[1]), 0.02, said.getvalue())
        # Two thirds of the errors are within their stated ones.
        self.assertTrue(0.60 < within < 0.75, said.getvalue())
        self.assertLess(rms, 1.5, said.getvalue())

    def test_the_true_surface_scores_nothing(self):
        with contextlib.redirect_stdout(io.StringIO()) as said:
            glass_score.score_mesh(self.directory / "surface.ply", self.directory / "surface.ply", 1000)
        self.assertEqual(said.getvalue().count("median 0.0000 mm"), 2, said.getvalue())

    def test_colmap_reprojects_its_points(self):
        done = subprocess.run(["colmap", "model_analyzer", "--path", self.camera / "colmap/sparse/0"], text=True, timeout=60,
                              capture_output=True, env=dict(os.environ, QT_QPA_PLATFORM="offscreen"))
        found = re.search(r"Mean reprojection error: ([\d.e-]+)px", done.stdout + done.stderr)
        self.assertIsNotNone(found, done.stdout + done.stderr)
        self.assertLess(float(found[1]), 0.1)

    def test_sofast_decodes_the_fringes(self):
        points, lit = np.load(self.camera / "neto/screen_point.npy")[0], None
        with h5py.File(self.camera / "sofast/measurement-crystal-000.h5") as file:
            group = file["MeasurementSofastFringe"]
            images, masks = group["fringe_images"][()], group["mask_images"][()]
            periods = [group["fringe_periods_y"][()], group["fringe_periods_x"][()]]
            self.assertEqual(group["name"][()].decode(), "crystal-000")
            self.assertEqual(images.shape, (*CAMERA[::-1], 4 * sum(map(len, periods))))
            self.assertGreater((masks[..., 1] - masks[..., 0]).max(), 100)
        with h5py.File(self.camera / "sofast/rig-crystal-000.h5") as file:
            self.assertEqual(file["DisplayShape/screen_model"][()].decode(), "rectangular2D")
            screen = np.array([file["DisplayShape/screen_x"][()], file["DisplayShape/screen_y"][()]])
            turn, shift = file["SpatialOrientation/r_cam_screen"][()], file["SpatialOrientation/v_cam_screen_cam"][()]
            self.assertEqual(list(file["Camera/image_shape_xy"][()]), list(CAMERA))
        # Four steps of a quarter; each finer fringe chooses among the places that the coarser one leaves.
        fractions = []
        for axis, first in ((0, 0), (1, 4 * len(periods[0]))):
            place = None
            for number, period in enumerate(periods[axis]):
                a, b, c, d = (images[..., first + 4 * number + k] for k in range(4))
                here = np.mod(np.arctan2(b - d, a - c) / (2 * np.pi), 1) / period
                place = here if place is None else here + np.round((place - here) * period) / period
            fractions.append(place)
        on_screen = (np.stack([fractions[1], fractions[0], np.full_like(place, 0.5)], axis=2) - 0.5) * [*screen, 0]
        # Half a turn about the screen's normal, without another turn of this rig.
        self.assertAlmostEqual(np.linalg.norm(turn), np.pi, places=6)
        seen = 1000 * (on_screen * [-1, -1, 1] + shift)
        pose = np.linalg.inv(np.array(glass_pose(self.camera)))
        seen = seen @ pose[:3, :3].T + pose[:3, 3]
        lit = points.any(axis=2)
        off = np.linalg.norm((seen - points)[lit], axis=1)
        # Reflections mix in; where there are none, the fringes are those of the strongest mode.
        self.assertLess(np.quantile(off, 0.25), 0.1)

    def test_photographs_are_the_frames_in_linear_light(self):
        photographs = sorted((self.camera / "idr/photographs").glob("crystal-000-*.exr"))
        self.assertEqual(len(photographs), 1)
        frame = glasswing.read_picture(photographs[0])
        matte = glasswing.Matte.read(self.camera / "crystal-000.exr")
        composite = matte.composite({"back": glasswing.read_picture(ROOT / "deploy/pictures/harbour.png")})
        self.assertGreater(psnr(frame, composite), 35.0)

    def test_the_picture_from_the_monitor_is_the_simulators(self):
        truth = self.directory / "truth.exr"
        words = [*MONITOR, *CAMERA, FOCAL_PX, 0, truth]
        subprocess.run([BIN / "simulated-from-monitor", *map(str, words)], check=True, timeout=100)
        matte = glasswing.Matte.read(self.camera / "crystal-000.exr")
        # The archive's scale is that of the camera's longest exposure: what white is beside the crystal.
        white = np.median(matte.composite({"back": np.ones((*MONITOR[::-1], 3))}, exact=True)[matte.coverage == 0])
        own, expected = matte.from_monitor("back") / white, glasswing.read_picture(truth)
        # Light is focused to several times that of an empty stage; the brightest is full scale.
        self.assertGreater(expected.max(), 2.0)
        self.assertGreater(psnr(own / expected.max(), expected / expected.max()), 40.0)


def glass_pose(camera: pathlib.Path) -> list[list[float]]:
    import json

    return json.loads((camera / "poses.json").read_text())["object_to_rig"]["crystal-000"]


if __name__ == "__main__":
    unittest.main()
