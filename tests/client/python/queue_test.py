"""The queue of captures from Python, on a simulated rig."""

import datetime
import unittest

import glasswing
from simulated_rig import ROOT, SimulatedRig
from lab import until  # noqa: E402  (simulated_rig adds its directory to the path)


class Queue(unittest.TestCase):
    """Added, moved, approved and run."""

    def setUp(self) -> None:
        self.lab = SimulatedRig("--size", "128x104")
        self.addCleanup(self.lab.stop)
        self.rig = glasswing.connect(self.lab.server)
        self.addCleanup(self.rig.close)
        self.plan = glasswing.Plan.read(ROOT / "deploy/plans/quick.txtpb")

    def ended(self, number: int) -> glasswing.QueueItem:
        until(lambda: self.rig.queue.item(number).ended is not None, f"item {number} has ended", 100.0)
        return self.rig.queue.item(number)

    def test_items_run_in_their_order_and_are_remembered(self) -> None:
        queue = self.rig.queue
        first = queue.add(self.plan, "first", tags=["night"], approval=True)
        second = queue.add(self.plan, "vase-{item}")
        copy = queue.duplicate(first.number)
        queue.move(copy.number, before=second.number)
        self.assertEqual([item.number for item in queue.items()], [first.number, copy.number, second.number])
        queue.remove(copy.number)
        with self.assertRaises(glasswing.NotFound):
            queue.item(copy.number)
        with self.assertRaisesRegex(glasswing.InvalidInput, "braces"):
            queue.add(self.plan, "{pose}")
        self.assertFalse(queue.running)
        now = datetime.datetime.now()
        held = queue.hold(now, now + datetime.timedelta(hours=1), "visitors")
        with self.assertRaises(glasswing.InvalidInput):
            queue.hold(now, now - datetime.timedelta(hours=1))
        queue.release(held)
        queue.approve(first.number)
        queue.start()
        self.assertTrue(queue.running)
        done = self.ended(first.number)
        self.assertEqual((done.state, done.session), (glasswing.ItemState.DONE, "first"))
        self.assertEqual(self.rig.session("first").info.tags, ("night",))
        self.assertEqual(self.ended(second.number).session, f"vase-{second.number}")
        queue.pause()
        self.assertEqual(queue.items(), [])
        self.assertEqual([item.session for item in queue.items(ended=True)], ["first", f"vase-{second.number}"])
        events = [event.what for event in queue.history(first.number)]
        self.assertEqual(events, ["done", "captured as session first", "begun", "approved", "added"])
        with self.assertRaisesRegex(glasswing.Refused, "only one that waits"):
            queue.run(first.number)
        with self.assertRaisesRegex(glasswing.NotFound, "has no composite"):
            queue.composite("first")
        picture = ROOT / "deploy/pictures/quilt.png"
        with self.assertRaisesRegex(glasswing.InvalidInput, "ask for the solve too"):
            queue.add(self.plan, "second", background={"back": picture})
        queue.add(self.plan, "second", solve=True, background={"back": picture}, deadline=now)


if __name__ == "__main__":
    unittest.main()
