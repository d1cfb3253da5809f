#!/usr/bin/python3
"""The axis of a simulated turntable whose place is known: a series of poses of boards on it, glasswing calibrate axis, and the
poses of its sessions; and the same from known points in a file."""

import json
import math
import pathlib
import subprocess
import sys
import unittest

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
import simulated_rig  # noqa: E402

import glasswing  # noqa: E402

# Monitor back has pixels of 1 mm and fills the picture; scene "board" stands half of its width before it.
WIDTH, HEIGHT, CAMERA_WIDTH, CAMERA_HEIGHT, FOCAL_PX = 160, 120, 320, 240, 560
DISTANCE_MM = FOCAL_PX * WIDTH / CAMERA_WIDTH
AXIS_MM = DISTANCE_MM - WIDTH / 2
GEOMETRY = f"""
camera {{ width_px: {CAMERA_WIDTH} height_px: {CAMERA_HEIGHT} fx_px: {FOCAL_PX} fy_px: {FOCAL_PX}
         cx_px: {CAMERA_WIDTH / 2} cy_px: {CAMERA_HEIGHT / 2} }}
monitors {{ name: "back" width_px: {WIDTH} height_px: {HEIGHT} pitch_mm: 1 rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1]
           translation_mm: [{-WIDTH / 2}, {-HEIGHT / 2}, {DISTANCE_MM}] }}
"""
PLAN = 'method: "gaussian"\nsolids { colour: [1, 1, 1] }\nskip_empty_stage: true\nhold_refreshes: 2\nexposure_ms: 4\n'
MAX_DEG, MAX_MM = 0.05, 0.05


class AxisTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rig = simulated_rig.SimulatedRig(
            "--size", f"{WIDTH}x{HEIGHT}", "--camera-size", f"{CAMERA_WIDTH}x{CAMERA_HEIGHT}", "--focal-length", str(FOCAL_PX),
            "--scene", "board", "--camera-options", "--axis=turn=0:360,--true-wobble=0.02")
        cls.rig.patience_s = 500
        cls.addClassCleanup(cls.rig.stop)
        cls.geometry = cls.rig.work / "rig.txtpb"
        cls.geometry.write_text(GEOMETRY)

    def check_axis(self, found: dict, direction: np.ndarray, point_mm: np.ndarray) -> None:
        off_deg = math.degrees(np.linalg.norm(np.cross(found["direction"], direction)))
        off_mm = np.linalg.norm(np.cross(np.array(found["point_mm"]) - point_mm, direction))
        print(f"off by {off_deg:.4f} +- {found['direction_sd_deg']:.4f} degrees, {off_mm:.4f} +- {found['point_sd_mm']:.4f} mm")
        self.assertLess(off_deg, MAX_DEG)
        self.assertLess(off_mm, MAX_MM)
        self.assertGreater(np.dot(found["direction"], direction), 0.0)

    def refused(self, error: str, *arguments: str) -> None:
        done = subprocess.run([simulated_rig.BIN / "glasswing", *arguments], env=self.rig.environment, capture_output=True,
                              text=True, timeout=100)
        self.assertNotEqual(done.returncode, 0, done.stdout)
        self.assertIn(error, done.stderr)

    def test_the_axis_is_found_from_boards_and_gives_poses(self):
        plan = self.rig.work / "plan.txtpb"
        plan.write_text(PLAN)
        self.rig.glasswing("capture", str(plan), "--turn", "0:330:30", "--session", "board")
        self.refused('the geometry has no axis "turn"; glasswing calibrate axis', "poses", "--series", "board", "--geometry",
                     str(self.geometry))
        found = json.loads(self.rig.glasswing("--json", "calibrate", "axis", "--series", "board", "--board", "7x5:8:6:4",
                                              "--geometry", str(self.geometry), "-o", str(self.geometry)))
        self.assertEqual(found["axis"], "turn")
        self.assertEqual(found["warnings"], [])
        self.assertEqual([each["position_deg"] for each in found["positions"]], list(range(0, 360, 30)))
        self.check_axis(found, np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, AXIS_MM]))
        written = json.loads(self.rig.glasswing("poses", "--series", "board", "--geometry", str(self.geometry)))
        self.assertEqual(written["positions"]["board-090"], 90)
        pose = np.array(written["object_to_rig"]["board-090"])
        np.testing.assert_allclose(pose[3], [0, 0, 0, 1])
        # A quarter turn, clockwise from above: what is right of the axis comes towards the camera.
        np.testing.assert_allclose(pose[:3, :3] @ [1, 0, 0], [0, 0, -1], atol=2 * math.radians(MAX_DEG))
        np.testing.assert_allclose(pose[:3, 3], found["point_mm"])
        with glasswing.connect(self.rig.server) as rig:
            geometry = glasswing.read_geometry(self.geometry)
            np.testing.assert_allclose(rig.session("board-090").pose(geometry), pose, atol=1e-12)

        for words, error in ((("--series", "vase", "--board", "7x5:8:6"), 'there is no series "vase"'),
                             (("--series", "board"), "--board is missing"),
                             (("--series", "board", "--board", "7x5"), "COLUMNSxROWS:SQUARE_MM:MARKER_MM"),
                             (("--series", "board", "--board", "9x9:8:6:4"), "needs 160 markers"),
                             (("--series", "board", "--board", "7x5:8:6", "--dictionary", "6x6_50"), "are seen at 0 of 12"),
                             (("board-000", "--points", str(self.geometry), "--board", "7x5:8:6"), "either from sessions")):
            self.refused(error, "calibrate", "axis", *words, "--geometry", str(self.geometry), "-o", "-")

    def test_the_axis_is_found_from_known_points(self):
        random = np.random.default_rng(3)
        direction = np.array([0.1, 0.97, -0.2])
        direction /= np.linalg.norm(direction)
        point_mm = np.array([5.0, -3.0, 210.0])
        across = np.array([[0, -direction[2], direction[1]], [direction[2], 0, -direction[0]], [-direction[1], direction[0], 0]])
        corners = np.array([[x, y, z] for x in (-25.0, 25.0) for y in (-20.0, 20.0) for z in (-15.0, 15.0)])
        lines = ["# a cuboid"]
        for position in range(0, 360, 20):
            angle = math.radians(position)
            turn = np.eye(3) + math.sin(angle) * across + (1 - math.cos(angle)) * across @ across
            for corner in corners:
                at = point_mm + turn @ (corner + [3.0, 1.0, -2.0])
                pixel = FOCAL_PX * at[:2] / at[2] + [CAMERA_WIDTH / 2, CAMERA_HEIGHT / 2] + random.normal(0, 0.03, 2)
                lines.append(" ".join(f"{number:.6f}" for number in (position, *pixel, *corner)))
        track = self.rig.work / "track.txt"
        track.write_text("\n".join(lines) + "\n")
        out = self.rig.work / "tracked.txtpb"
        (self.rig.work / "plain.txtpb").write_text(GEOMETRY)
        command = ("--json", "calibrate", "axis", "--points", str(track), "--geometry", str(self.rig.work / "plain.txtpb"),
                   "-o", str(out))
        found = json.loads(self.rig.glasswing(*command))
        self.check_axis(found, direction, point_mm)
        track.write_text("\n".join([*lines, "0 1 2 3 4"]))
        self.refused(f"track.txt:{len(lines) + 1}: it must be six numbers", *command)


if __name__ == "__main__":
    unittest.main()
