#!/usr/bin/python3
"""A series of poses on a simulated turntable (glasswing capture --turn): the empty stage once, the object turned in each
session, and a series that goes on where it was after each daemon was killed."""

import json
import pathlib
import re
import shlex
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
import simulated_rig  # noqa: E402

import glasswing  # noqa: E402
import numpy as np  # noqa: E402

PLAN = 'method: "hierarchical"\nsquare_waves { levels: 3 }\nsolids { colour: [1, 1, 1] }\nhold_refreshes: 2\nexposure_ms: 4\n'
AXIS = "--axis=turn=-90:360,--axis-speed=400"


class TurnTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rig = simulated_rig.SimulatedRig("--size", "96x80", "--camera-options", AXIS)
        cls.addClassCleanup(cls.rig.stop)
        cls.plan = cls.rig.work / "plan.txtpb"
        cls.plan.write_text(PLAN)

    def turn(self, series: str, poses: str, *options: str) -> subprocess.Popen:
        """Starts a series."""
        command = [simulated_rig.BIN / "glasswing", "capture", self.plan, "--turn", poses, "--session", series, *options]
        return subprocess.Popen(command, env=self.rig.environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, text=True)

    def ended(self, series: subprocess.Popen) -> str:
        said, _ = series.communicate(timeout=400)
        self.assertEqual(series.returncode, 0, said)
        return said

    def sessions(self, series: str) -> list[dict]:
        """In the order in which they were created."""
        found = json.loads(self.rig.glasswing("sessions", "--tag", series, "--json"))["sessions"]
        return [self.rig.shown(each["name"]) for each in sorted(found, key=lambda each: each["name"])]

    def archive(self, session: str) -> tuple[dict, pathlib.Path]:
        folder = self.rig.work / "rig/camera/archives" / session
        return json.loads((folder / "manifest.json").read_text()), folder

    def check_series(self, series: str, positions: list[float]) -> None:
        """Each pose once and whole: each step has one frame, those of the empty stage are the first session's."""
        sessions = self.sessions(series)
        self.assertEqual([each["axes"]["turn"] for each in sessions], positions)
        first, first_folder = self.archive(sessions[0]["name"])
        empty = {frame.get("step", 0): frame for frame in first["frames"] if not frame.get("object")}
        self.assertGreater(len(empty), 3)
        for session in sessions:
            manifest, folder = self.archive(session["name"])
            self.assertEqual(manifest["axes"], session["axes"])
            steps = [frame.get("step", 0) for frame in manifest["frames"]]
            self.assertEqual(sorted(steps), list(range(session["step_count"])), session["name"])
            # A killed node may leave a file that it was writing, under a temporary name.
            stored = {f"frames/{path.name}" for path in (folder / "frames").glob("[!.]*.tif")}
            self.assertEqual(stored, {frame["file"] for frame in manifest["frames"]})
            for frame in manifest["frames"]:
                if frame.get("object"):
                    continue
                self.assertEqual(frame, empty[frame.get("step", 0)])
                self.assertTrue((folder / frame["file"]).samefile(first_folder / frame["file"]))

    def object_frames(self, session: str) -> list[np.ndarray]:
        """The frames with the object in the order of the steps, without the id patch."""
        manifest, folder = self.archive(session)
        frames = [frame for frame in manifest["frames"] if frame.get("object")]
        return [np.asarray(glasswing.read_picture(folder / frame["file"]), dtype=float)[:68]
                for frame in sorted(frames, key=lambda frame: frame["step"])]

    def frame(self, session: str) -> np.ndarray:
        return self.object_frames(session)[-1]

    def test_each_pose_is_a_session_and_shows_the_object_turned(self):
        said = self.ended(self.turn("vase", "0:40:20"))
        self.assertIn("3 poses; glasswing sessions --tag vase", said)
        self.check_series("vase", [0.0, 20.0, 40.0])
        self.assertEqual([each["name"] for each in self.sessions("vase")], ["vase-00", "vase-20", "vase-40"])
        shown = self.rig.glasswing("show", "vase-20")
        self.assertRegex(shown, r"pose +turn at 20")
        self.assertRegex(shown, r"stage +the empty one of session vase-00")
        self.assertRegex(shown, "turn at 20 deg, pose 2 of 3")
        # By hand at the same angle, with an empty stage of its own: the same light but for the noise.
        self.rig.glasswing("stage", "20")
        self.rig.glasswing("capture", str(self.plan), "--session", "alone", "--watch")
        noise = np.abs(self.frame("vase-20") - self.frame("alone")).mean()
        for other in ("vase-00", "vase-40"):
            self.assertGreater(np.abs(self.frame("vase-20") - self.frame(other)).mean(), 5 * noise)
        # Once more: nothing is captured again.
        created = [each["created"] for each in self.sessions("vase")]
        self.ended(self.turn("vase", "0:40:20"))
        self.assertEqual([each["created"] for each in self.sessions("vase")], created)
        self.rig.glasswing("delete", "vase-00", "--yes")
        self.rig.glasswing("solve", "vase-40", "--watch")  # whole without the session whose empty stage it has

    def test_a_series_goes_on_where_it_was_when_daemons_are_killed(self):
        series = self.turn("ring", "0:100:25")
        killed = []
        for daemon, pose in (("camera-1", "ring-000"), ("server", "ring-025"), ("display-1", "ring-050")):
            self.wait_for(pose)
            self.rig.kill(daemon)
            killed.append(daemon)
            self.rig.start_again()
        # The client itself.
        self.wait_for("ring-075")
        series.kill()
        series.communicate()
        self.ended(self.turn("ring", "0:100:25"))
        self.check_series("ring", [0.0, 25.0, 50.0, 75.0, 100.0])
        # What went on after a kill went on in its pose, as captures by hand show. Those have other id patches, which the
        # object shows too, so steps count that tell poses apart.
        alone = []
        for pose in (0, 25, 50, 75):
            self.rig.glasswing("stage", f"{pose}")
            self.rig.glasswing("capture", str(self.plan), "--session", f"alone-{pose}", "--watch")
            alone.append((f"ring-{pose:03d}", self.object_frames(f"alone-{pose}")))
        for (session, own), (_, other) in zip(alone, alone[1:] + alone[:1]):
            told = 0
            for there, here, elsewhere in zip(self.object_frames(session), own, other, strict=True):
                apart = np.abs(here - elsewhere).mean()
                told += apart > 0.03
                if apart > 0.03:
                    self.assertLess(np.abs(there - here).mean(), apart / 2, session)
            self.assertGreater(told, 5, session)

    def test_the_queue_captures_each_pose_once_though_the_server_is_killed(self):
        self.rig.glasswing("queue", "add", str(self.plan), "--session", "night", "--turn", "0:60:20", "--retry-wait", "1")
        self.rig.glasswing("queue", "start")
        self.wait_for("night-20")
        self.rig.kill("server")
        self.rig.start_again()
        for _ in range(2000):
            if not json.loads(self.rig.glasswing("queue", "list", "--json")).get("items"):
                break
        else:
            self.fail(self.rig.glasswing("queue", "list"))
        self.check_series("night", [0.0, 20.0, 40.0, 60.0])

    def wait_for(self, session: str) -> None:
        """Until some of its steps are proven, or all."""
        command = [simulated_rig.BIN / "glasswing", "show", session, "--json"]
        for _ in range(2000):
            done = subprocess.run(command, env=self.rig.environment, capture_output=True, text=True, timeout=60)
            if done.returncode == 0 and json.loads(done.stdout).get("proven_count", 0) > 0:
                return
        self.fail(f"{session} was not begun: {done.stderr}")

    def test_by_hand_and_bad_input(self):
        self.rig.glasswing("stage", "--home")
        (axis,) = json.loads(self.rig.glasswing("stage", "turn=30", "--json"))
        self.assertEqual(axis, {"name": "turn", "unit": "deg", "min": -90.0, "max": 360.0, "homes": True, "position": 30.0})
        for words, error in ((("stage", "400"), 'axis "turn" shall move to 400 deg; it takes -90 to 360'),
                             (("stage", "tilt=3"), 'the stage has no axis "tilt"; it has: turn'),
                             (("stage", "north"), 'the position is "north"; it must be a number'),
                             (("capture", str(self.plan), "--turn", "0:360:90", "--session", "bad"), "--turn has 360 deg, where"),
                             (("capture", str(self.plan), "--turn", "0,400", "--session", "bad"), "takes -90 to 360 deg"),
                             (("capture", str(self.plan), "--turn", "0:90:-10", "--session", "bad"), "the step must lead to LAST"),
                             (("capture", str(self.plan), "--turn", "0:90", "--session", "bad"), "FIRST:LAST:STEP"),
                             (("capture", str(self.plan), "--turn", "0,90"), "--turn needs --session")):
            with self.assertRaisesRegex(AssertionError, re.escape(error)):
                self.rig.glasswing(*words)
        self.assertEqual(self.sessions("bad"), [])

    def test_the_commands_of_the_page(self):
        """Those that docs/turntable.md gives to try, on this rig."""
        page = (simulated_rig.ROOT / "docs/turntable.md").read_text()
        lines = re.findall(r"^    (\S.*)$", page.split("## Try it")[1].split("## A series")[0], re.MULTILINE)
        self.assertIn("--axis=turn=0:360", lines[0])
        commands = [shlex.split(line)[1:] for line in lines if line.startswith("glasswing ")]
        self.assertEqual(len(commands), len(lines) - 2)
        self.rig.glasswing("stage", "0")
        for words in commands:
            words = [word.replace("deploy/", f"{simulated_rig.ROOT}/deploy/").replace("vase", "page") for word in words]
            if "-o" in words:
                words[-1] = str(self.rig.work / words[-1])
            self.rig.glasswing(*words)
        self.assertEqual([each["state"] for each in self.sessions("page")], [self.sessions("page")[0]["state"]] * 3)
        self.assertTrue((self.rig.work / "page-20.exr").exists())

    def test_stop_ends_a_move(self):
        self.rig.glasswing("stage", "0")
        move = subprocess.Popen([simulated_rig.BIN / "glasswing", "stage", "360"], env=self.rig.environment,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while move.poll() is None:
            self.rig.glasswing("stage", "--stop")
        self.assertIn("was stopped on its way to 360 deg", move.communicate()[1])
        (axis,) = json.loads(self.rig.glasswing("stage", "--json"))
        self.assertNotIn("position", axis)


if __name__ == "__main__":
    unittest.main()
