"""A session through separate processes, driven from Python: the capture and its events, the matte and its arrays, and
errors. The command line and an independent reader of OpenEXR give the truth."""

import dataclasses
import functools
import json
import subprocess
import unittest

import exr_reader
import numpy as np
import simulated_rig

import glasswing

# Sixty steps, two seconds.
PLAN = glasswing.Plan(
    method="hierarchical",
    monitors=[glasswing.PlanMonitor("back")],
    square_waves=glasswing.SquareWaves(levels=7),
    solids=[glasswing.Solid(glasswing.BLACK), glasswing.Solid(glasswing.WHITE)],
)
QUILT = simulated_rig.ROOT / "deploy/pictures/quilt.png"


class SessionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemons = simulated_rig.SimulatedRig()
        cls.addClassCleanup(cls.daemons.stop)
        cls.rig = glasswing.connect(cls.daemons.server)
        cls.addClassCleanup(cls.rig.close)
        cls.vase = cls.rig.capture(PLAN, name="vase")
        cls.capture_events = list(cls.vase.events())
        cls.vase.solve()
        cls.solve_events = list(cls.vase.events())
        cls.file = cls.daemons.work / "vase.exr"
        cls.matte = cls.vase.download(cls.file)

    def refused(self, kind: type[glasswing.Error], words: str, function, *arguments, **named):
        with self.assertRaises(kind) as caught:
            function(*arguments, **named)
        self.assertIs(type(caught.exception), kind)
        self.assertIn(words, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))

    def test_the_rig_tells_its_nodes(self):
        nodes = self.rig.nodes()
        kinds = {node.kind for node in nodes}
        self.assertEqual(kinds, set(glasswing.NodeKind))
        self.assertTrue(all(node.up and node.version == glasswing.__version__ for node in nodes))
        self.assertIsNone(self.rig.holder())

    def test_the_fleet_tells_who_solved_the_session(self):
        fleet = self.rig.fleet()
        [solver] = fleet.solvers
        self.assertEqual((solver.name, solver.threads, solver.refused), ("solver-1", 1, ""))
        self.assertTrue(solver.up and solver.host)
        self.assertEqual(solver.version, glasswing.__version__)
        self.assertEqual((solver.tiles_done, solver.tiles_failed), (self.solve_events[-1].tiles, 0))
        self.assertEqual((solver.leases, fleet.solves), ((), ()))
        self.assertTrue(fleet.store)

    def test_events_tell_the_capture_from_begin_to_end(self):
        proven = [event.steps_proven for event in self.capture_events]
        self.assertEqual(proven, sorted(proven))
        self.assertEqual([event.state for event in self.capture_events[:-1] if event.state.rests], [])
        last = self.capture_events[-1]
        self.assertIs(last.state, glasswing.State.CAPTURED)
        self.assertEqual((last.steps_proven, last.steps_proven_by_patch), (last.steps, last.steps))
        self.assertEqual(last.steps_proven_by_time, 0)
        self.assertEqual(last.plan.square_waves, PLAN.square_waves)

    def test_events_tell_the_solve(self):
        self.assertIs(self.solve_events[0].state, glasswing.State.SOLVING)
        last = self.solve_events[-1]
        self.assertIs(last.state, glasswing.State.DONE)
        self.assertEqual(last.tiles_done, last.tiles)

    def test_the_server_tells_what_is_allowed(self):
        allowed = self.vase.refresh().allowed_actions
        self.assertLess({glasswing.Action.SOLVE, glasswing.Action.DELETE}, allowed)
        self.assertTrue(allowed.isdisjoint({glasswing.Action.PAUSE, glasswing.Action.RESUME, glasswing.Action.RETRY}))
        self.assertIn(glasswing.Action.CANCEL, self.solve_events[0].allowed_actions)

    def test_the_command_line_shows_the_same_session(self):
        shown, info = self.daemons.shown("vase"), self.vase.refresh()
        self.assertEqual(shown["state"], f"SESSION_STATE_{info.state.name}")
        self.assertEqual((shown["step_count"], shown["proven_count"]), (info.steps, info.steps_proven))
        self.assertEqual(shown["pixel_count"], str(self.matte.coverage.size))
        self.assertEqual(tuple(shown.get("matte_warnings", ())), self.matte.warnings)
        self.assertEqual(info.matte_warnings, self.matte.warnings)
        object_pixels = self.matte.coverage > 0
        self.assertEqual(shown["object_pixel_count"], str(np.count_nonzero(object_pixels)))
        self.assertEqual(shown["flagged_pixel_count"], str(np.count_nonzero(self.matte.flags[object_pixels])))

    def test_arrays_are_what_is_in_the_file(self):
        parts = exr_reader.read_exr(self.file)
        foreground, modes = parts["foreground"], self.matte.modes
        for channel, letter in enumerate("RGB"):
            np.testing.assert_array_equal(self.matte.foreground[:, :, channel], foreground[f"F.{letter}"])
        np.testing.assert_array_equal(self.matte.coverage, foreground["coverage.Y"])
        np.testing.assert_array_equal(self.matte.flags, foreground["flags.Y"])
        names = {field.name.removesuffix("_px2").removesuffix("_px"): field.name for field in dataclasses.fields(modes)}
        for mode in range(modes.weight.shape[3]):
            for layer, name in names.items():
                for channel, letter in enumerate("RGB"):
                    np.testing.assert_array_equal(
                        getattr(modes, name)[:, :, channel, mode], parts[f"mode{mode + 1}"][f"{layer}.{letter}"]
                    )

    def test_arrays_outlive_the_matte_and_cannot_be_written(self):
        matte = self.vase.fetch()
        arrays = [matte.foreground, matte.coverage, matte.flags, *vars(matte.modes).values()]
        copies = [array.copy() for array in arrays]
        del matte
        for array, copy in zip(arrays, copies):
            np.testing.assert_array_equal(array, copy)
            self.assertRaises(ValueError, array.fill, 0)

    def test_a_region_is_that_of_the_whole(self):
        height, width = self.matte.coverage.shape
        part = self.vase.fetch(crop=f"{width - 7}x{height - 5}+4+3")
        for name in ("foreground", "coverage", "flags"):
            np.testing.assert_array_equal(getattr(part, name), getattr(self.matte, name)[3:-2, 4:-3])
        np.testing.assert_array_equal(part.modes.weight, self.matte.modes.weight[3:-2, 4:-3])
        for crop in (f"{width + 1}x1+0+0", "3x3", "3x3+-1+0", "0x1+0+0"):
            with self.assertRaises(glasswing.InvalidInput):
                self.vase.fetch(crop=crop)

    def test_frames_are_those_of_an_export(self):
        here, there = self.daemons.work / "here", self.daemons.work / "there"
        self.vase.export(here)
        self.daemons.glasswing("export", "vase", str(there))
        frames = self.vase.frames()
        self.assertEqual(len(frames), self.vase.info.steps)
        files = sorted(file.relative_to(there) for file in there.rglob("*") if file.is_file())
        self.assertEqual(files, sorted(file.relative_to(here) for file in here.rglob("*") if file.is_file()))
        for file in files:
            if file.suffix == ".tif":
                self.assertEqual((here / file).read_bytes(), (there / file).read_bytes())
        manifests = [json.loads((directory / "manifest.json").read_text()) for directory in (here, there)]
        self.assertEqual(*manifests)
        # Its pixels, as another program reads them.
        middle = len(frames) // 2
        plain = self.daemons.work / "frame.exr"
        subprocess.run(["oiiotool", str(there / frames[middle].file), "-d", "float", "-o", str(plain)], check=True)
        planes = exr_reader.read_exr(plain)[""]
        codes = np.stack([np.rint(planes[letter] * 65535.0) for letter in "RGB"], -1)
        np.testing.assert_array_equal(frames[middle].read(), codes)
        height, width, _ = frames.shape
        np.testing.assert_array_equal(frames.pixel(width - 1, height - 1)[middle], codes[-1, -1])
        np.testing.assert_array_equal(frames.rows(3, 2)[middle], codes[3:5])

    def test_what_is_solved_so_far_of_a_finished_session_is_its_matte(self):
        np.testing.assert_array_equal(self.vase.draft().modes.weight, self.matte.modes.weight)

    def test_metadata(self):
        self.assertEqual(self.matte.metadata.session, "vase")
        self.assertEqual(self.matte.metadata.method, "hierarchical")
        self.assertEqual(self.matte.monitors, ("back",))

    def test_a_composite_is_that_of_the_command_line(self):
        output = self.daemons.work / "composite.exr"
        self.daemons.glasswing("composite", str(self.file), "--background", str(QUILT), "-o", str(output))
        written = exr_reader.read_exr(output)[""]
        composite = self.matte.composite({"back": glasswing.read_picture(QUILT)})
        for channel, letter in enumerate("RGB"):
            np.testing.assert_array_equal(composite[:, :, channel], written[letter])

    def test_a_composite_is_near_the_exact_one(self):
        quilt = glasswing.read_picture(QUILT)
        off = self.matte.composite({"back": quilt}) - self.matte.composite({"back": quilt}, exact=True)
        self.assertLessEqual(np.sqrt(np.mean(off**2)), 0.002)  # what the fast compositor promises

    def test_an_error_that_is_not_known_is_refused(self):
        # Method hierarchical does not say how it sampled.
        self.refused(glasswing.Refused, "does not record how it was sampled", self.matte.error, {"back": glasswing.read_picture(QUILT)})

    def test_in_front_of_black_only_the_foreground_is_left(self):
        np.testing.assert_array_equal(self.matte.composite({}), self.matte.foreground)

    def test_a_picture_that_cannot_be_a_background(self):
        codes = np.zeros((4, 4, 3), np.uint8)
        refused = functools.partial(self.refused, glasswing.InvalidInput)
        refused('no monitor "left"; this matte has: back', self.matte.composite, {"left": codes})
        refused("background back is of type uint8", self.matte.composite, {"back": codes})
        refused("(4, 4)", self.matte.composite, {"back": codes[:, :, 0]})

    def test_a_file_that_is_no_matte(self):
        self.refused(glasswing.NotFound, "none.exr", glasswing.Matte.read, self.daemons.work / "none.exr")
        damaged = self.daemons.work / "damaged.exr"
        damaged.write_bytes(self.file.read_bytes()[:-100])
        self.refused(glasswing.Damaged, "damaged.exr", glasswing.Matte.read, damaged)

    def test_a_capture_is_paused_and_resumed(self):
        session = self.rig.capture(PLAN, name="paused")
        next(session.events())
        session.pause()
        with self.assertRaises(glasswing.Stopped) as caught:
            session.wait()
        self.assertIs(caught.exception.info.state, glasswing.State.PAUSED)
        self.assertLess(caught.exception.info.steps_proven, session.info.steps)
        session.resume()
        self.assertEqual(session.wait().steps_proven, session.info.steps)

    def test_a_capture_is_cancelled(self):
        session = self.rig.capture(PLAN)  # the server names it
        self.assertTrue(session.name)
        session.cancel()
        self.assertRaises(glasswing.Stopped, session.wait)
        self.assertIs(session.info.state, glasswing.State.CANCELLED)

    def test_waiting_is_given_up(self):
        session = self.rig.capture(PLAN, name="slow")
        self.refused(glasswing.TimedOut, "session slow is capturing", session.wait, timeout=0.1)
        session.wait()

    def test_who_is_not_there(self):
        self.refused(glasswing.Unavailable, "server at 127.0.0.1:1 does not answer", glasswing.connect, "127.0.0.1:1")
        self.refused(glasswing.NotFound, 'no session "nobody"', self.rig.session, "nobody")

    def test_what_the_server_refuses(self):
        bad = dataclasses.replace(PLAN, sweeps=[glasswing.Sweep(0, sigma_px=0)])
        self.refused(glasswing.InvalidInput, "sweeps[0].sigma_px is 0; it must be in (0, 200]", self.rig.capture, bad)
        self.refused(glasswing.AlreadyExists, '"vase"', self.rig.capture, PLAN, name="vase")
        self.refused(glasswing.InvalidInput, "gaussian", self.vase.solve, "nonsense")
        elsewhere = dataclasses.replace(PLAN, monitors=[glasswing.PlanMonitor("front")])
        self.refused(glasswing.InvalidInput, "front", self.rig.capture, elsewhere)


if __name__ == "__main__":
    unittest.main()
