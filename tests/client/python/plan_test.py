"""Plans in Python are the messages that the server checks."""

import pathlib
import tempfile
import unittest

import simulated_rig
from google.protobuf import text_format

import glasswing
from glasswing.v1 import plan_pb2

# Every field of every message has another value than its default.
FULL = glasswing.Plan(
    method="gaussian",
    monitors=[glasswing.PlanMonitor("back", 1920, 1080), glasswing.PlanMonitor("left")],
    sweeps=[glasswing.Sweep(45, sigma_px=4, step_px=2, margin_sigmas=1, peak=0.5), glasswing.Sweep(0, 8)],
    solids=[glasswing.Solid(glasswing.BLACK), glasswing.Solid((0.25, 0.5, 0.75))],
    square_waves=glasswing.SquareWaves(7, first_level=2, without_complements=True),
    ramp=glasswing.Ramp(empty_frames=3, frames=30),
    photos=[glasswing.Photo("harbour.png", name="harbour")],
    hold_refreshes=3,
    exposure_ms=[1, 4],
    retries=0,
    skip_empty_stage=True,
    calibration=glasswing.CalibrationFrames("display", takes=2, grays=9),
    white_every=50,
    fringes=[glasswing.Fringes(90, period_px=[144, 64], phases=3, object_only=True)],
    camera="studio",
    cameras=["left", "right"],
    adapt=glasswing.Adapt(target_db=42, target_px=0.1, at_most=100, footprints="any"),
    rounds=[glasswing.Round([glasswing.Fringes(45, period_px=[12], phases=2, object_only=True)], why="edges")],
)


class PlanTest(unittest.TestCase):
    def test_every_field_of_the_message_is_there(self):
        def check(message):
            self.assertEqual({f.name for f, _ in message.ListFields()}, {f.name for f in message.DESCRIPTOR.fields})
            for field, value in message.ListFields():
                if field.message_type is not None:
                    check(value[0] if field.label == field.LABEL_REPEATED else value)

        check(FULL.to_message())

    def test_text_and_message_keep_the_plan(self):
        self.assertEqual(glasswing.Plan.from_message(FULL.to_message()), FULL)
        self.assertEqual(glasswing.Plan.parse(FULL.text()), FULL)

    def test_what_is_zero_or_left_out_stays_so(self):
        plan = glasswing.Plan(method="gaussian", sweeps=[glasswing.Sweep(0, sigma_px=0)], ramp=glasswing.Ramp())
        self.assertEqual(glasswing.Plan.from_message(plan.to_message()), plan)
        self.assertFalse(plan.to_message().HasField("retries"))
        self.assertTrue(FULL.to_message().HasField("retries"))  # 0, which is no default

    def test_the_plans_that_come_along(self):
        for path in sorted((simulated_rig.ROOT / "deploy/plans").glob("*.txtpb")):
            with self.subTest(plan=path.name):
                message = text_format.Parse(path.read_text(), plan_pb2.Plan())
                self.assertEqual(glasswing.Plan.read(path).to_message(), message)

    def test_photos_are_found_beside_the_plan(self):
        with tempfile.TemporaryDirectory() as directory:
            path = pathlib.Path(directory, "plan.txtpb")
            FULL.write(path)
            (photo,) = glasswing.Plan.read(path).photos
            self.assertEqual(photo, glasswing.Photo(f"{directory}/harbour.png", name="harbour"))

    def test_what_cannot_be_a_plan(self):
        def refused(words, function, *arguments):
            with self.assertRaises(glasswing.InvalidInput) as caught:
                function(*arguments)
            self.assertIn(words, str(caught.exception))

        refused("vase.txtpb:2:", glasswing.Plan.parse, 'method: "alpha"\nsweep {}\n', "vase.txtpb")
        refused("exposure_ms is 4", glasswing.Plan(method="alpha", exposure_ms=4).to_message)
        wide = glasswing.Plan(method="alpha", fringes=[glasswing.Fringes(0, [100]), glasswing.Fringes(0, ["wide"])])
        refused("fringes[1].period_px is ('wide',)", wide.to_message)
        with self.assertRaises(glasswing.NotFound):
            glasswing.Plan.read("/nonexistent/plan.txtpb")


if __name__ == "__main__":
    unittest.main()
