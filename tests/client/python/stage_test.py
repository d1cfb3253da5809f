"""The stage from Python: its axes, a series of poses, and the object's pose on an axis whose place is known."""

import math
import unittest

import numpy as np
import simulated_rig

import glasswing
from glasswing.stage import pose_names
from glasswing.v1 import rays_pb2


class PoseTest(unittest.TestCase):
    def geometry(self) -> rays_pb2.RigGeometry:
        geometry = rays_pb2.RigGeometry()
        axis = geometry.axes.add(name="turn")
        axis.direction.extend([0.6, 0.8, 0.0])
        axis.point_mm.extend([1.0, 2.0, 200.0])
        return geometry

    def test_the_pose_turns_about_the_axis_through_its_point(self):
        pose = glasswing.object_to_rig(self.geometry(), {"turn": 90.0})
        np.testing.assert_allclose(pose[:3, 3], [1, 2, 200])
        np.testing.assert_allclose(pose[:3, :3] @ [0.6, 0.8, 0.0], [0.6, 0.8, 0.0])  # the axis stays
        np.testing.assert_allclose(pose[:3, :3] @ [0.8, -0.6, 0.0], [0.0, 0.0, -1.0], atol=1e-12)  # right-handed
        # A turn of 30 degrees three times is one of 90, and a full one is none.
        third = glasswing.object_to_rig(self.geometry(), {"turn": 30.0})[:3, :3]
        np.testing.assert_allclose(third @ third @ third, pose[:3, :3], atol=1e-12)
        np.testing.assert_allclose(glasswing.object_to_rig(self.geometry(), {"turn": 360.0})[:3, :3], np.eye(3), atol=1e-12)
        self.assertAlmostEqual(math.sqrt(np.linalg.det(pose)), 1.0)

    def test_missing_axes_are_named(self):
        with self.assertRaisesRegex(glasswing.Refused, 'no axis "lift"; glasswing calibrate axis'):
            glasswing.object_to_rig(self.geometry(), {"lift": 3.0})
        with self.assertRaisesRegex(glasswing.InvalidInput, "there are 0"):
            glasswing.object_to_rig(self.geometry(), {})

    def test_names_are_those_of_the_command_line(self):
        self.assertEqual(pose_names("vase", [0, 10, 350]), ["vase-000", "vase-010", "vase-350"])
        self.assertEqual(pose_names("vase", [0, 7.5]), ["vase-0.0", "vase-7.5"])
        self.assertEqual(pose_names("vase", [-20, 5]), ["vase--20", "vase-005"])


class StageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rig = simulated_rig.SimulatedRig("--size", "96x80", "--camera-options", "--axis=turn=-90:360")
        cls.addClassCleanup(cls.rig.stop)

    def test_axes_move_home_and_stop(self):
        with glasswing.connect(self.rig.server) as rig:
            stage = rig.stage()
            (axis,) = stage.axes()
            self.assertEqual((axis.name, axis.unit, axis.min, axis.max), ("turn", "deg", -90.0, 360.0))
            (axis,) = stage.move({"turn": 25.5})
            self.assertEqual(axis.position, 25.5)
            self.assertEqual(stage.axes()[0].position, 25.5)
            with self.assertRaisesRegex(glasswing.InvalidInput, "-90 to 360"):
                stage.move({"turn": 400.0})
            stage.stop()
            (axis,) = stage.home()
            self.assertEqual(axis.position, 0.0)

    def test_a_series_is_that_of_the_command_line_and_is_taken_up_again(self):
        plan = glasswing.Plan(solids=[glasswing.Solid(glasswing.WHITE)], exposure_ms=[4], method="hierarchical",
                              square_waves=glasswing.SquareWaves(2))
        with glasswing.connect(self.rig.server) as rig:
            first = [session.name for session in rig.capture_turn(plan, "ring", [0, 40])]
            self.assertEqual(first, ["ring-00", "ring-40"])
            again = list(rig.capture_turn(plan, "ring", [0, 40, 80]))
            self.assertEqual([dict(session.info.axes) for session in again], [{"turn": 0.0}, {"turn": 40.0}, {"turn": 80.0}])
            self.assertEqual({session.name for session in rig.sessions(tags=["ring"])}, {"ring-00", "ring-40", "ring-80"})
            self.assertRegex(rig.session("ring-40").info.note, "turn at 40 deg, pose 2 of 2")
            with self.assertRaisesRegex(glasswing.NotFound, 'no axis "lift"; it has: turn'):
                next(rig.capture_turn(plan, "ring", [0], axis="lift"))


if __name__ == "__main__":
    unittest.main()
