#!/usr/bin/python3
"""`glasswing calibrate geometry` and `glasswing rays` of sessions on a server, of a rig of simulated devices. Its
monitor never moves, so no pose opens a lens, and rays have a geometry by hand; rail_test.py has a rig that can."""

import json
import os
import pathlib
import pty
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
import simulated_rig  # noqa: E402

PLANS = simulated_rig.ROOT / "deploy/plans"
GEOMETRY = "camera { width_px: 160 height_px: 120 fx_px: 250 fy_px: 250 cx_px: 80 cy_px: 60 }\n" + "".join(
    f'monitors {{ name: "{name}" width_px: 128 height_px: 96 pitch_mm: 1 rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] '
    f"translation_mm: [-64, -48, {depth}] }}\n"
    for name, depth in (("near", 200), ("far", 250))
)


class SessionGeometryTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rig = simulated_rig.SimulatedRig("--camera-size", "160x120")
        cls.addClassCleanup(cls.rig.stop)
        cls.output = cls.rig.work / "output"
        cls.output.mkdir()

    def solved(self, plan: str, *names: str) -> None:
        for name in names:
            self.rig.glasswing("capture", str(PLANS / plan), "--session", name, "--solve", "--watch")

    def refused(self, words: str, *command: object) -> None:
        program = [simulated_rig.BIN / "glasswing", *map(str, command)]
        done = subprocess.run(program, env=self.rig.environment, capture_output=True, text=True, timeout=100)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn(words, done.stderr.splitlines()[-1])  # a slow fetch tells that it waits
        self.assertEqual(list(self.output.iterdir()), [])

    def test_parallel_poses_are_refused_in_plain_words(self):
        self.solved("hierarchical.txtpb", "one", "two", "three")
        command = ["calibrate", "geometry", "one", "two", "--pitch-mm", 1, "-o", self.output / "rig.txtpb"]
        self.refused("there are 2 poses", *command)
        self.refused("the poses do not determine the lens: all poses are parallel", *command, "three")
        self.refused('there is no session "four"', *command, "four")

    def test_without_a_rail_the_operator_moves_the_monitor(self):
        capture = ["capture", PLANS / "quick.txtpb", "--session", "hand", "--rail-mm"]
        self.refused('monitor back has no rail (glasswing-display --rail), and standard input is not a terminal', *capture, "7,8.5")
        self.refused('monitor "back" has no rail to move it', "rail", "7")
        self.rig.glasswing(*map(str, capture), "6")  # taken at their word
        self.assertEqual(self.rig.shown("hand-6")["rail_mm"], {"back": 6})
        self.refused('session "hand-6" already exists', *capture, "back:6")
        theirs, ours = pty.openpty()
        self.addCleanup(os.close, theirs)
        os.write(theirs, b"\n\n")  # the answers
        program = [simulated_rig.BIN / "glasswing", *map(str, capture), "7,8.5"]
        done = subprocess.run(program, env=self.rig.environment, stdin=ours, capture_output=True, text=True, timeout=100)
        os.close(ours)
        self.assertEqual(done.returncode, 0, done.stderr)
        for position in (7, 8.5):
            self.assertIn(f"move monitor back to {position} mm, then press Enter", done.stderr)
            self.assertEqual(self.rig.shown(f"hand-{position}")["rail_mm"], {"back": position})
        follows = [f"glasswing solve hand-{position} --watch" for position in (7, 8.5)]
        follows.append("glasswing rays hand-7 hand-8.5 --geometry rig.txtpb -o hand-rays.exr")
        self.assertEqual(done.stdout.splitlines()[-3:], follows)

    def test_rays_are_those_of_fetched_files(self):
        self.solved("quick.txtpb", "near", "far")
        rig = self.rig.work / "rig.txtpb"
        rig.write_text(GEOMETRY)
        mattes = [self.rig.work / f"{name}.exr" for name in ("near", "far")]
        for matte in mattes:
            self.rig.glasswing("fetch", matte.stem, "-o", str(matte))
        made = {}
        for name, inputs in (("sessions", ("near", "far")), ("files", mattes)):
            made[name] = self.rig.work / f"{name}.exr"
            command = ["rays", *map(str, inputs), "--geometry", str(rig), "-o", str(made[name]), "--json"]
            self.assertGreater(json.loads(self.rig.glasswing(*command))["matched"], 3000)
        self.assertEqual(made["sessions"].read_bytes(), made["files"].read_bytes())
        self.assertEqual(list(self.rig.work.glob("*.tmp")), [])
        out = self.output / "rays.exr"
        self.refused('there is no session "side"', "rays", "near", "side", "--geometry", rig, "-o", out)


if __name__ == "__main__":
    unittest.main()
