#!/usr/bin/python3
"""The way from a rig to an object at any depth, on simulated devices whose lens and poses are known: calibrate the geometry
from tilted poses, capture at two positions of a rail, make rays, and composite at a third; against what the camera sees
when the rail stands there."""

import json
import math
import pathlib
import re
import subprocess
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
import simulated_rig  # noqa: E402

import glasswing  # noqa: E402

# Of the monitor and the camera's picture. Pixels of the monitor are 1 mm, those of the camera squares.
WIDTH, HEIGHT = 128, 96
CAMERA_WIDTH, CAMERA_HEIGHT = 96, 72
FOCAL_PX = 144.0
NEAR_MM, BETWEEN_MM, FAR_MM = 192.0, 212.0, 232.0
# Tilt and turn in degrees, position of the rail.
TILTS = ((25, 0, 200), (-25, 0, 200), (0, 25, 200), (0, -25, 200), (18, 18, 220), (-18, -18, 220))
# Of fifty images with the object, and bars that locate the stage beside it as well.
VASE = re.sub("square_waves.*", "square_waves { levels: 6 }", (simulated_rig.ROOT / "deploy/plans/design-50.txtpb").read_text())
BARE = 'method: "hierarchical"\nsquare_waves { levels: 7 }\nskip_empty_stage: true\nhold_refreshes: 2\nexposure_ms: 4\n'
PHOTO = 'method: "gaussian"\nphotos {{ file: "{}" }}\nsolids {{ colour: [0, 0, 0] }}\nhold_refreshes: 2\nexposure_ms: 4\n'
# Where the monitor stands for a photograph; PSNR inside the object that composites must reach there, and by how much they
# must be better than the near matte, whose picture is moved to its own plane.
FLOORS = ((NEAR_MM, 40.0, -3.0), (BETWEEN_MM, 30.0, 10.0), (FAR_MM, 40.0, 20.0))


def true_pose(tilt_deg: float, turn_deg: float, position_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and translation in the camera's frame of a monitor turned about its middle, which lies on the camera's axis:
    first tilted about x (its lower edge away), then turned about y (its right edge away)."""
    a, b = math.radians(tilt_deg), -math.radians(turn_deg)
    tilt = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    turn = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    rotation = turn @ tilt
    return rotation, np.array([0, 0, position_mm]) - rotation @ np.array([WIDTH / 2, HEIGHT / 2, 0])


def picture() -> np.ndarray:
    """A smooth coloured picture of the monitor's size, with detail down to some pixels."""
    random = np.random.default_rng(5)
    coarse = random.uniform(0.05, 0.95, (HEIGHT // 6, WIDTH // 6 + 1, 3))
    return glasswing.resized(coarse, WIDTH, HEIGHT)


def warped(shown: np.ndarray, shown_mm: float, plane_mm: float) -> np.ndarray:
    """The picture of a monitor at one depth, as it must stand at another one for the camera to see the same beside the
    object. Bilinear; black where the monitor was not."""
    middle = np.array([WIDTH / 2, HEIGHT / 2])
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    x = (x - middle[0]) * shown_mm / plane_mm + middle[0] - 0.5
    y = (y - middle[1]) * shown_mm / plane_mm + middle[1] - 0.5
    padded = np.pad(shown, ((1, 1), (1, 1), (0, 0)))
    i, j = np.clip(np.floor(x).astype(int), -1, WIDTH - 1), np.clip(np.floor(y).astype(int), -1, HEIGHT - 1)
    u, v = np.clip(x - i, 0, 1)[..., None], np.clip(y - j, 0, 1)[..., None]
    upper = padded[j + 1, i + 1] * (1 - u) + padded[j + 1, i + 2] * u
    lower = padded[j + 2, i + 1] * (1 - u) + padded[j + 2, i + 2] * u
    return upper * (1 - v) + lower * v


def poses_in(text: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Rotation and translation of the poses in a file of a rig's geometry, by name."""
    poses, name, rotation = {}, "", np.eye(3)
    for line in text.splitlines():
        field, _, value = line.strip().partition(": ")
        if field == "name":
            name = json.loads(value)
        elif field == "rotation":
            rotation = np.array(json.loads(value)).reshape(3, 3)
        elif field == "translation_mm":
            poses[name] = rotation, np.array(json.loads(value))
    return poses


class RailTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        size, camera_size = f"{WIDTH}x{HEIGHT}", f"{CAMERA_WIDTH}x{CAMERA_HEIGHT}"
        cls.options = ("--size", size, "--camera-size", camera_size, "--focal-length", f"{FOCAL_PX:g}", "--noise", "0.0005")
        cls.rig = simulated_rig.SimulatedRig(*cls.options, "--scene", "none")
        cls.rig.patience_s = 400
        cls.addClassCleanup(cls.rig.stop)
        cls.bare = cls.rig.work / "bare.txtpb"
        cls.bare.write_text(BARE)
        cls.vase = cls.rig.work / "vase.txtpb"
        cls.vase.write_text(VASE)

    def capture(self, plan: pathlib.Path, session: str, *positions_mm: float) -> list[str]:
        """Captures and solves; the names of the sessions."""
        series = ",".join(f"{position:g}" for position in positions_mm)
        said = self.rig.glasswing("capture", str(plan), "--session", session, "--rail-mm", series, "--solve", "--watch")
        names = [f"{session}-{position:g}" for position in positions_mm]
        if len(names) == 2:
            follows = f"glasswing rays {names[0]} {names[1]} --geometry rig.txtpb -o {session}-rays.exr"
            self.assertEqual(said.splitlines()[-1], follows)
        return names

    def calibrated(self) -> pathlib.Path:
        """The geometry as it is found, checked against the truth."""
        truths = {}
        for k, (tilt, turn, position) in enumerate(TILTS):
            self.rig.run("tilt", f"{tilt},{turn}")
            (name,) = self.capture(self.bare, f"tilt{k}", position)
            truths[name] = true_pose(tilt, turn, position)
        self.rig.run("tilt", "0,0")
        for name, position in zip(self.capture(self.bare, "bare", NEAR_MM, FAR_MM), (NEAR_MM, FAR_MM)):
            truths[name] = true_pose(0, 0, position)
        geometry = self.rig.work / "rig.txtpb"
        fit = json.loads(self.rig.glasswing("calibrate", "geometry", *truths, "--pitch-mm", "1", "-o", str(geometry), "--json"))
        self.assertEqual([pose["rail_mm"] for pose in fit["poses"]], [*(tilt[2] for tilt in TILTS), NEAR_MM, FAR_MM])
        self.check_geometry(fit, truths, poses_in(geometry.read_text()))
        return geometry

    def check_geometry(self, fit: dict, truths: dict, found: dict) -> None:
        """Bars of one pixel leave places open by a quarter of one, alike in neighbours: so five standard errors, and turns of
        an eighth of a pixel at the monitor's edge."""
        truth = {"fx": FOCAL_PX, "fy": FOCAL_PX, "cx": CAMERA_WIDTH / 2, "cy": CAMERA_HEIGHT / 2}
        for number, value in truth.items():
            print(f"{number} {fit[number + '_px']:.3f} +- {fit[number + '_sd_px']:.3f}, truly {value:g}")
            self.assertLess(fit[f"{number}_sd_px"], 5e-3 * FOCAL_PX)
            self.assertAlmostEqual(fit[f"{number}_px"], value, delta=5 * fit[f"{number}_sd_px"])
        middle = np.array([WIDTH / 2, HEIGHT / 2, 0])
        for pose in fit["poses"]:
            (rotation, translation), (true_rotation, true_translation) = found[pose["name"]], truths[pose["name"]]
            cosine = (np.trace(rotation @ true_rotation.T) - 1) / 2
            turned_deg = math.degrees(math.acos(min(1.0, cosine)))
            off_mm = np.linalg.norm(rotation @ middle + translation) - np.linalg.norm(true_rotation @ middle + true_translation)
            print(f"{pose['name']}: {turned_deg:.3f} degrees, {off_mm:.3f} mm off, +- {pose['distance_sd_mm']:.3f}")
            self.assertLess(turned_deg, math.degrees(math.atan(0.125 / (HEIGHT / 2))))
            self.assertLess(abs(off_mm), 5 * pose["distance_sd_mm"])

    def photographed(self, photo: pathlib.Path, position: float) -> pathlib.Path:
        """The camera's frame of the picture when the monitor stands there."""
        plan = photo.with_suffix(".txtpb")
        plan.write_text(PHOTO.format(photo.name))
        self.rig.glasswing("capture", str(plan), "--session", "truth", "--rail-mm", f"{position:g}")
        archive = self.rig.work / f"truth-{position:g}"
        self.rig.glasswing("export", archive.name, str(archive))
        manifest = json.loads((archive / "manifest.json").read_text())
        self.assertEqual(manifest["monitors"][0]["rail_mm"], position)
        return next(archive / frame["file"] for frame in manifest["frames"] if frame["stimulus"]["kind"] == "photo")

    def psnr_db(self, composite: pathlib.Path, frame: pathlib.Path, matte: pathlib.Path) -> float:
        """Of linear light, inside the object."""
        words = ("compare", str(composite), str(frame), "--linear", "--matte", str(matte), "--json")
        return json.loads(self.rig.glasswing(*words))["psnr_db"]

    def doctor(self, geometry: pathlib.Path, session: str) -> dict:
        """What it finds of the geometry."""
        command = [simulated_rig.BIN / "glasswing", "doctor", "--geometry", geometry, "--session", session, "--json"]
        done = subprocess.run(command, env=self.rig.environment, capture_output=True, text=True, timeout=100)
        (finding,) = [each for each in json.loads(done.stdout) if each["subject"] == "geometry"]
        print(finding["text"])
        return finding

    def test_an_object_stands_before_a_picture_at_a_depth_that_was_not_captured(self):
        geometry = self.calibrated()
        self.assertEqual(self.doctor(geometry, f"bare-{FAR_MM:g}")["level"], "ok")
        with self.assertRaisesRegex(AssertionError, "--rail-mm has 500; the rail of monitor \"back\" goes from 192 to 384 mm"):
            self.capture(self.bare, "beyond", NEAR_MM, 500)
        with self.assertRaisesRegex(AssertionError, 'session "bare-232" already exists'):
            self.capture(self.bare, "bare", BETWEEN_MM, FAR_MM)
        self.assertNotIn("-212", self.rig.glasswing("sessions"))
        self.rig.run("tilt", "0,3")
        (later,) = self.capture(self.bare, "later", NEAR_MM)
        moved = self.doctor(geometry, later)
        self.assertEqual(moved["level"], "problem")
        self.assertAlmostEqual(float(moved["text"].split()[-2]), 3.0, delta=0.1)
        self.rig.run("down")
        self.rig.run("up", "--port", self.rig.server.split(":")[1], "--solvers", "1", *self.options, "--scene", "glass")
        vase = self.capture(self.vase, "vase", NEAR_MM, FAR_MM)
        self.assertEqual(self.doctor(geometry, vase[0])["level"], "ok")
        rays, near, photo = (self.rig.work / name for name in ("rays.exr", "near.exr", "photo.exr"))
        poses = f"bare-{NEAR_MM:g},bare-{FAR_MM:g}"
        words = ["rays", *vase, "--geometry", str(geometry), "-o", str(rays), "--poses"]
        self.assertIn(f"mm from the camera, {FAR_MM:g} mm on its rail", self.rig.glasswing(*words, poses))
        with self.assertRaisesRegex(AssertionError, "was at 192 mm on its rail .* pose .* has it at 232 mm"):
            self.rig.glasswing(*words, f"bare-{FAR_MM:g},bare-{NEAR_MM:g}")
        self.rig.glasswing("fetch", vase[0], "-o", str(near))
        shown = picture()
        glasswing.write_picture(photo, shown)
        for position, floor_db, gain_db in FLOORS:
            frame = self.photographed(photo, position)
            ours, background, moved = (self.rig.work / f"{name}{position:g}.exr" for name in ("ours", "background", "moved"))
            self.rig.glasswing("composite", str(rays), "--plane", f"{position:g}:{photo}", "-o", str(ours))
            glasswing.write_picture(background, warped(shown, position, NEAR_MM))
            self.rig.glasswing("composite", str(near), "--background", str(background), "-o", str(moved))
            ours_db, moved_db = (self.psnr_db(composite, frame, near) for composite in (ours, moved))
            print(f"at {position:g} mm: {ours_db:.1f} dB by rays, {moved_db:.1f} dB by the near matte, moved")
            self.assertGreater(ours_db, floor_db)
            self.assertGreater(ours_db - moved_db, gain_db)


if __name__ == "__main__":
    unittest.main()
