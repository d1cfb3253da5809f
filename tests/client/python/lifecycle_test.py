"""Sessions before and after their capture, and holds of the rig, through separate processes."""

import dataclasses
import datetime
import json
import subprocess
import sys
import unittest

import simulated_rig

import glasswing
from glasswing import pictures

PLAN = glasswing.Plan(
    method="hierarchical",
    monitors=[glasswing.PlanMonitor("back")],
    square_waves=glasswing.SquareWaves(levels=3),
    solids=[glasswing.Solid(glasswing.BLACK), glasswing.Solid(glasswing.WHITE)],
)
QUILT = simulated_rig.ROOT / "deploy/pictures/quilt.png"
HOLD_UNTIL_KILLED = """
import sys, glasswing
with glasswing.connect() as rig, rig.hold("somebody's series"):
    print("held", flush=True)
    sys.stdin.read()
"""


class LifecycleTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemons = simulated_rig.SimulatedRig()
        cls.addClassCleanup(cls.daemons.stop)
        cls.rig = glasswing.connect(cls.daemons.server)
        cls.addClassCleanup(cls.rig.close)

    def refused(self, kind: type[glasswing.Error], words: str, function, *arguments, **named):
        with self.assertRaises(kind) as caught:
            function(*arguments, **named)
        self.assertIs(type(caught.exception), kind)
        self.assertIn(words, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))

    def captured(self, name: str, plan: glasswing.Plan = PLAN) -> glasswing.Session:
        session = self.rig.capture(plan, name=name)
        session.wait()
        return session

    def test_an_estimate_is_what_a_capture_takes(self):
        estimate = self.rig.estimate(PLAN, "estimated")
        self.assertEqual([session.name for session in self.rig.sessions(text="estimated")], [])
        info = self.captured("estimated").info
        self.assertEqual(estimate.steps, info.steps)
        self.assertEqual([(m.name, m.width_px, m.height_px) for m in estimate.monitors], [("back", 128, 96)])
        self.assertEqual((estimate.camera_width_px, estimate.camera_height_px), (128, 104))
        self.assertGreater(estimate.free_bytes, estimate.bytes)
        self.assertLessEqual(estimate.seconds, info.capture_seconds)

        self.refused(glasswing.AlreadyExists, "estimated", self.rig.estimate, PLAN, "estimated")
        bad = dataclasses.replace(PLAN, retries=-1)
        self.refused(glasswing.InvalidInput, "retries is -1", self.rig.estimate, bad)

    def test_notes_and_tags_are_found(self):
        red, green = (self.captured(name) for name in ("red", "green"))
        for session in (red, green):
            session.annotate(add_tags=["glass"])
        info = red.annotate(note="A Crystal from Bohemia", add_tags=["cut", "lead"])
        self.assertEqual((info.note, info.tags), ("A Crystal from Bohemia", ("cut", "glass", "lead")))
        self.assertEqual(red.annotate(remove_tags=["lead"]).note, "A Crystal from Bohemia")
        self.refused(glasswing.InvalidInput, "tag", red.annotate, add_tags=["two words"])

        def found(tags=("glass",), **conditions):
            return [session.name for session in self.rig.sessions(tags=tags, **conditions)]

        self.assertEqual(found(), ["green", "red"])
        self.assertEqual(found(text="crystal"), ["red"])
        self.assertEqual(found(["glass", "cut"]), ["red"])
        self.assertEqual(found(["glass", "lead"]), [])
        self.assertEqual(found(states=[glasswing.State.CAPTURED]), ["green", "red"])
        self.assertEqual(found(states=[glasswing.State.DONE]), [])
        self.assertEqual(found(since=red.info.created), ["green", "red"])
        self.assertEqual(found(since=green.info.created + datetime.timedelta(seconds=1)), [])
        self.assertEqual(found(before=red.info.created), [])

    def test_a_session_is_deleted(self):
        session = self.rig.capture(PLAN, name="short-lived")
        self.refused(glasswing.Refused, "short-lived", session.delete)
        info = session.wait()
        self.assertGreaterEqual(session.delete(), info.archive_bytes)
        self.refused(glasswing.NotFound, '"short-lived"', session.refresh)
        self.refused(glasswing.NotFound, '"short-lived"', self.rig.session, "short-lived")

    def test_a_hold_keeps_others_out(self):
        with glasswing.connect(self.daemons.server) as other:
            with self.rig.hold("a series"):
                for rig in (self.rig, other):
                    self.assertEqual(rig.holder().what, "a series")
                self.refused(glasswing.Refused, "a series", other.capture, PLAN, name="intruder")
                self.refused(glasswing.Refused, "a series", other.hold("another series").__enter__)
                self.captured("in-series-1")
                self.captured("in-series-2")
                self.refused(glasswing.Refused, "holds the rig already", self.rig.hold("twice").__enter__)
            other.capture(PLAN, name="after").wait()
            self.assertIsNone(other.holder())

    def test_after_a_pattern_the_rig_is_free_at_once_also_within_a_hold(self):
        for name in ("lines", "white"):
            with self.rig.pattern(name):
                self.assertEqual(self.rig.holder().what, f"pattern {name}")
        with self.rig.hold("focus"):
            for name in ("lines", "white"):
                with self.rig.pattern(name):
                    self.assertEqual(self.rig.holder().what, f"focus (pattern {name})")
            self.captured("after-patterns")

    def test_a_holder_that_dies_lets_go(self):
        holder = subprocess.Popen([sys.executable, "-c", HOLD_UNTIL_KILLED], env=self.daemons.environment,
                                  stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        with holder:
            self.assertEqual(holder.stdout.readline(), "held\n")
            self.refused(glasswing.Refused, "somebody's series", self.rig.capture, PLAN, name="early")
            holder.kill()
        while self.rig.holder() is not None:  # the test's time limit ends this otherwise
            pass
        with self.rig.hold("after him"):
            self.assertEqual(self.rig.holder().what, "after him")
        with self.rig.hold("at once again"):
            pass

    def test_photos_are_sent(self):
        plan = dataclasses.replace(PLAN, photos=[glasswing.Photo(str(QUILT))])
        self.captured("photographed", plan)
        self.daemons.glasswing("export", "photographed", str(self.daemons.work / "archive"))
        manifest = json.loads((self.daemons.work / "archive/manifest.json").read_text())
        (shown,) = [frame["stimulus"] for frame in manifest["frames"] if frame["stimulus"]["kind"] == "photo"]
        self.assertEqual(shown["name"], "quilt")
        fitted = pictures.resized(glasswing.read_picture(QUILT), 128, 96)
        self.assertEqual(shown["image"], self.rig.upload(fitted))  # names are hashes of what is in them
        missing = dataclasses.replace(PLAN, photos=[glasswing.Photo("/nonexistent.png")])
        self.refused(glasswing.NotFound, "/nonexistent.png", self.rig.capture, missing)


class LostServerTest(unittest.TestCase):
    def test_a_hold_that_was_lost_is_told(self):
        daemons = simulated_rig.SimulatedRig()
        self.addCleanup(daemons.stop)
        with glasswing.connect(daemons.server) as rig, rig.hold("a series"):
            daemons.kill("server")
            rig._connection.hold.call.code()  # waits until the call has ended
            daemons.start_again()
            with self.assertRaises(glasswing.Unavailable) as caught:
                rig.capture(PLAN)
            self.assertIn('the hold "a series" was lost', str(caught.exception))
            with glasswing.connect(daemons.server) as other:
                self.assertIsNone(other.holder())


if __name__ == "__main__":
    unittest.main()
