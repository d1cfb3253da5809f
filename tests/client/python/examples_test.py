"""The example scripts, run as a person would on a simulated rig of two monitors."""

import dataclasses
import pathlib
import signal
import subprocess
import sys
import unittest

import simulated_rig

import glasswing

EXAMPLES = simulated_rig.ROOT / "client/python/examples"
WAVES = glasswing.Plan(
    method="hierarchical",
    monitors=[glasswing.PlanMonitor("back"), glasswing.PlanMonitor("left")],
    square_waves=glasswing.SquareWaves(levels=2),
    solids=[glasswing.Solid(glasswing.BLACK), glasswing.Solid(glasswing.WHITE)],
)
# Long enough for an exposure of 6 ms, whatever the camera's phase.
SLOW = dataclasses.replace(WAVES, monitors=[glasswing.PlanMonitor("back")], hold_refreshes=3)


class ExamplesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        # Exposures of up to 6.7 ms; this camera clips white from 4.5 ms on.
        cls.daemons = simulated_rig.SimulatedRig("--monitors", "2", "--fps", "150", "--size", "96x80")
        cls.addClassCleanup(cls.daemons.stop)
        cls.rig = glasswing.connect(cls.daemons.server)
        cls.addClassCleanup(cls.rig.close)
        cls.plan, cls.slow_plan = cls.daemons.work / "plan.txtpb", cls.daemons.work / "slow.txtpb"
        WAVES.write(cls.plan)
        SLOW.write(cls.slow_plan)

    def start(self, script: str, *arguments: str) -> subprocess.Popen:
        return subprocess.Popen(
            [sys.executable, str(EXAMPLES / script), *arguments], env=self.daemons.environment, cwd=self.daemons.work,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )

    def run_script(self, script: str, *arguments: str, status: int = 0) -> str:
        """Returns its output."""
        with self.start(script, *arguments) as process:
            said, _ = process.communicate(timeout=120)
        self.assertEqual(process.returncode, status, said)
        return said

    def test_help(self):
        for script in sorted(EXAMPLES.glob("*.py")):
            said = self.run_script(script.name, "--help")
            self.assertIn("usage: ", said)
            self.assertIn("export PYTHONPATH", said)

    def turns(self) -> list[str]:
        return (self.daemons.work / "turns").read_text().split()

    def test_turntable_is_taken_up_where_it_broke_off(self):
        turn = self.daemons.work / "turn"
        turn.write_text(f'#!/bin/sh\necho "$1" >> {self.daemons.work}/turns\n')
        turn.chmod(0o755)
        series = ("turntable.py", "cup", "--views", "3", "--plan", str(self.plan), "--turn-command", str(turn))
        with self.start(*series) as begun:
            first = begun.stdout.readline()
            self.assertTrue(first.startswith("cup-000: view 1 of 3, 0 degrees"), first)
            begun.send_signal(signal.SIGINT)
            said, _ = begun.communicate(timeout=60)
        self.assertEqual(begun.returncode, 1, said)
        self.assertIn("continues the series", said)

        created = self.rig.session("cup-000").info.created
        self.run_script(*series)
        self.assertEqual(self.turns().count("0"), 1)
        self.assertLessEqual({"120", "240"}, set(self.turns()))
        self.assertEqual(self.rig.session("cup-000").info.created, created)
        for number in range(3):
            info = self.rig.session(f"cup-{number:03d}").info
            self.assertIs(info.state, glasswing.State.DONE)
            self.assertEqual(info.tags, ("cup", "turntable"))
            matte = glasswing.Matte.read(self.daemons.work / f"cup/cup-{number:03d}.exr")
            self.assertEqual(matte.metadata.session, info.name)
            self.assertEqual(matte.monitors, ("back", "left"))

    def test_turntable_does_not_mix_series(self):
        self.rig.capture(WAVES, name="mug-000").wait()
        other = ("turntable.py", "mug", "--views", "1", "--turn-command", "true")
        self.assertIn("mug-000 has a different plan", self.run_script(*other, status=1))

    def test_exposure_sweep_finds_the_longest_that_does_not_clip(self):
        said = self.run_script("exposure_sweep.py", "bowl", "--exposures", "6", "4", "50", "--plan", str(self.slow_plan))
        rows = {line.split()[0]: line.split()[1:] for line in said.splitlines()[1:]}
        self.assertEqual(rows["4"][2], "0")
        self.assertGreater(int(rows["6"][2]), 0)
        self.assertIn("exposure", " ".join(rows["50"]))  # which the camera cannot make
        self.assertIn("best: 4 ms, session bowl-4ms", said)
        swept = [session.name for session in self.rig.sessions(tags=["exposure-sweep"])]
        self.assertEqual(swept, ["bowl-6ms", "bowl-4ms"])

    def test_sessions_are_solved_again_past_failures(self):
        for name in ("jug-1", "jug-2"):
            session = self.rig.capture(WAVES, name=name)
            session.annotate(add_tags=["jug"])
            session.wait()
        listed = self.run_script("resolve_last_week.py", "--tag", "jug", "--dry-run")
        self.assertIn("2 sessions would be solved", listed)
        self.assertLess(listed.index("jug-1"), listed.index("jug-2"))
        self.assertIs(self.rig.session("jug-1").info.state, glasswing.State.CAPTURED)

        said = self.run_script("resolve_last_week.py", "--tag", "jug", "--days", "1")
        self.assertIn("2 of 2 sessions were solved", said)
        self.assertEqual(self.rig.session("jug-2").info.method, "hierarchical")

        # A method that these captures cannot be solved by.
        said = self.run_script("resolve_last_week.py", "--tag", "jug", "--method", "fringe", status=1)
        self.assertIn("0 of 2 sessions were solved", said)
        self.assertTrue(self.rig.session("jug-2").info.matte_ready)

    def test_a_server_that_is_not_there(self):
        for script, arguments in (("turntable.py", ["x"]), ("exposure_sweep.py", ["x"]), ("resolve_last_week.py", [])):
            said = self.run_script(script, *arguments, "--server", "127.0.0.1:1", status=1)
            self.assertEqual(said, f"{pathlib.Path(script).stem}: server at 127.0.0.1:1 does not answer; start glasswing-server there, or name another\n")


if __name__ == "__main__":
    unittest.main()
