"""A series of poses on a simulated turntable, captured and solved by one command while the server, the camera node, the display
node and a solver are killed once each, and then the command itself. Run again, the command must go on where it was: sessions that
were captured stay as they are, and in the end each pose has one session, one frame of each step, and one matte."""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import subprocess
import sys
import time
from typing import Any

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / folder) for folder in ("processes", "client/python")]

from lab import until  # noqa: E402
from simulated_rig import BIN, SimulatedRig  # noqa: E402

SERIES = "ring"


class Series:
    def __init__(self, options: argparse.Namespace) -> None:
        # Without an id patch, which the object would cover on a small monitor.
        focal_px = 4 * int(options.size.split("x")[0])
        self.rig = SimulatedRig("--size", options.size, "--focal-length", f"{focal_px}", "--camera-options", "--axis=turn=0:360,--axis-speed=400")
        self.step = 360 // options.poses
        self.positions = [float(self.step * i) for i in range(options.poses)]
        self.plan = self.rig.work / "plan.txtpb"
        try:
            self.rig.glasswing("plan", "design", "--images", "50", "--noise", "0.001", "--monitor", f"back:{options.size}", "-o", str(self.plan))
        except BaseException:
            self.rig.stop()
            raise
        self.plan.write_text(self.plan.read_text() + "retries: 100\n")
        self.archives = self.rig.work / "rig/camera/archives"
        self.mattes = self.rig.work / "rig/server/mattes"

    def start(self) -> subprocess.Popen[str]:
        poses = f"0:{self.positions[-1]:g}:{self.step}"
        command = [BIN / "glasswing", "capture", self.plan, "--turn", poses, "--session", SERIES, "--solve"]
        return subprocess.Popen(command, env=self.rig.environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, text=True)

    def sessions(self) -> list[dict[str, Any]]:
        try:
            found = json.loads(self.rig.glasswing("sessions", "--tag", SERIES, "--json"))["sessions"]
        except AssertionError:  # the server was killed
            return []
        return sorted(found, key=lambda each: each["name"])

    def until_begun(self, count: int, run: subprocess.Popen[str]) -> None:
        def begun() -> bool:
            assert run.poll() is None, run.communicate()[0]
            return len(self.sessions()) >= count

        until(begun, f"{count} poses were begun", 900.0, 0.3)

    def captured(self) -> dict[str, Any]:
        """When the frames of whole sessions were written."""
        whole = [each["name"] for each in self.sessions() if each.get("proven_count") == each["step_count"]]
        return {name: {path.name: path.stat().st_mtime_ns for path in (self.archives / name / "frames").glob("[!.]*.tif")}
                for name in whole}

    def check(self) -> int:
        sessions = self.sessions()
        shown = [self.rig.shown(each["name"]) for each in sessions]
        assert [each["axes"]["turn"] for each in shown] == self.positions, [each["name"] for each in sessions]  # type: ignore[index]
        for session in sessions:
            assert session["state"] == "SESSION_STATE_DONE", session
            frames = json.loads((self.archives / session["name"] / "manifest.json").read_text())["frames"]
            steps = sorted(frame.get("step", 0) for frame in frames)
            assert steps == list(range(session["step_count"])), f"{session['name']}: a step has no frame, or two"
        mattes = sorted(path.stem for path in self.mattes.glob("*.exr"))
        assert mattes == [session["name"] for session in sessions], mattes
        return len(mattes)


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests/bench/turntable/run", description=__doc__)
    parser.add_argument("--poses", type=int, default=36, help="evenly round; at least 12, a divisor of 360 (default 36)")
    parser.add_argument("--size", default="64x48", help="resolution of the simulated camera and monitor in px (default 64x48)")
    options = parser.parse_args()
    if options.poses < 12 or 360 % options.poses != 0:
        parser.error(f"--poses is {options.poses}; it must be 12 or more, and divide 360")
    series = Series(options)
    try:
        began = time.monotonic()
        run = series.start()
        victims = ("server", "camera-1", "display-1", "solver-1")
        for number, victim in enumerate(victims, 1):
            series.until_begun(number * options.poses // (len(victims) + 2), run)
            series.rig.kill(victim)
            series.rig.start_again()
        series.until_begun(5 * options.poses // 6, run)
        run.kill()
        run.communicate()
        before = series.captured()
        run = series.start()
        said, _ = run.communicate(timeout=1800)
        assert run.returncode == 0, said
        took = time.monotonic() - began
        assert len(before) > options.poses // 2
        after = series.captured()
        assert all(after[name] == times for name, times in before.items()), "a captured session was captured again"
        count = series.check()
    finally:
        series.rig.stop()
    print(f"{options.poses} poses at {options.size}: {count} mattes, none twice; {len(before)} were captured before the command was killed, "
          f"and stayed as they were")
    print(f"killed once each: {', '.join(victims)}, the command; {took:.0f} s, load {os.getloadavg()[0]:.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
