"""A night's queue on a simulated rig: items of which one cannot run, no client, and every daemon killed at least twice.
Measures the time of the whole queue beside the sum of its items, each timed alone before, and checks that all others are
captured and solved, each exactly once."""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import random
import statistics
import sys
import tempfile
import time
from typing import Any

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / folder) for folder in ("processes", "bench")]

from daemon import ROOT, Daemon, free_port  # noqa: E402
from lab import glasswing, until  # noqa: E402
from postgres import Postgres  # noqa: E402
from rows import row  # noqa: E402

_ALONE = 3  # items timed by themselves


class Rig:
    """A server, a display node, a camera node and two solvers."""

    def __init__(self, work: pathlib.Path, size: str, jobs: str) -> None:
        port = free_port(3)
        self.work, self.address = work, f"127.0.0.1:{port}"
        display, camera = (f"127.0.0.1:{port + offset}" for offset in (1, 2))
        commands = {
            "server": ["glasswing-server", "--listen", self.address, "--data", str(work / "server"), *(("--jobs", jobs) if jobs else ())],
            "display": ["glasswing-display", "--listen", display, "--server", self.address, "--name", "display-1", "--backend", "sim"]
            + ["--monitor", f"back={size}@60", "--patch-rows", "8"],
            "camera": ["glasswing-camera", "--listen", camera, "--server", self.address, "--name", "camera-1", "--data", str(work / "camera")]
            + ["--size", size, "--tap", display],
        }
        for number in (1, 2):
            commands[f"solver-{number}"] = ["glasswing-solver", "--server", self.address, "--name", f"solver-{number}", "--threads", "1"]
        self.daemons = {name: Daemon(name, command, work / f"{name}.log") for name, command in commands.items()}
        for daemon in self.daemons.values():
            daemon.start()
        until(lambda: self.is_ready(), "all nodes are up", 120.0, 0.5)

    def is_ready(self) -> bool:
        try:
            nodes = json.loads(self.run("nodes", "--json"))["nodes"]
        except AssertionError:
            return False
        return sum(bool(node["up"]) for node in nodes) == 4

    def run(self, *arguments: str) -> str:
        return glasswing(self.address, *arguments)

    def items(self) -> list[dict[str, Any]]:
        try:
            items: list[dict[str, Any]] = json.loads(self.run("queue", "list", "--all", "--json"))["items"]
        except AssertionError:  # the server was killed
            return []
        return items

    def until_ended(self, count: int, seconds: float) -> None:
        until(lambda: sum(bool(item["ended"]) for item in self.items()) == count, f"{count} items have ended", seconds, 0.5)

    def close(self) -> None:
        for daemon in reversed(self.daemons.values()):
            daemon.end()


def kill_all_twice(rig: Rig, seconds: float, rng: random.Random) -> dict[str, int]:
    """Kills at random moments, spread over that time, and restarts at once. Returns how often each was killed."""
    victims = [name for name in rig.daemons for _ in range(2)]
    rng.shuffle(victims)
    began, count = time.monotonic(), len(rig.items())
    moments = sorted(rng.uniform(0.05, 0.9) * seconds for _ in victims)
    killed = dict.fromkeys(rig.daemons, 0)
    for victim, moment in zip(victims, moments, strict=True):
        until(lambda at=moment: time.monotonic() - began >= at, "the moment has come", seconds + 60.0)  # type: ignore[misc]
        items = rig.items()
        assert not items or sum(bool(item["ended"]) for item in items) < count, "the queue was faster than the kills"
        rig.daemons[victim].kill()
        rig.daemons[victim].start()
        killed[victim] += 1
    return killed


def check(rig: Rig, count: int) -> tuple[int, list[str]]:
    """Returns how many were done, and the failures. Nothing is lost, nothing is there twice."""
    items = [item for item in rig.items() if item["wish"]["session"].startswith(("vase", "impossible"))]
    done = [item for item in items if item["state"] == "QUEUE_ITEM_STATE_DONE"]
    failed = [f"{item['wish']['session']}: {item['reason']}" for item in items if item["state"] == "QUEUE_ITEM_STATE_FAILED"]
    sessions = {session["name"]: session for session in json.loads(rig.run("sessions", "vase", "--json"))["sessions"]}
    assert len(items) == count and len({item["session"] for item in done}) == len(done) == len(sessions), sorted(sessions)
    for item in done:
        session = sessions[item["session"]]
        assert session["state"] == "SESSION_STATE_DONE" and session["proven_count"] == session["step_count"], session
        events = json.loads(rig.run("queue", "history", "--item", str(item["number"]), "--json"))["events"]
        assert sum(event["what"].startswith("captured as session") for event in events) == 1, events
        frames = rig.work / "camera/archives" / item["session"] / "manifest.json"
        steps = [frame["step"] for frame in json.loads(frames.read_text())["frames"] if "step" in frame]
        assert len(steps) == len(set(steps)), f"{item['session']}: a step has two frames"
        assert (rig.work / "server/mattes" / f"{item['session']}.exr").exists(), item
    return len(done), failed


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests/bench/night/run", description=__doc__)
    parser.add_argument("--items", type=int, default=40)
    parser.add_argument("--size", default="128x104", help="resolution of the simulated camera and monitor in px (default 128x104)")
    parser.add_argument("--plan", type=pathlib.Path, default=ROOT / "deploy/plans/quick.txtpb")
    parser.add_argument("--seed", type=int, default=1, help="of the moments and the order of the kills")
    parser.add_argument("--postgres", action="store_true", help="jobs in PostgreSQL; default: SQLite")
    options = parser.parse_args()
    postgres = Postgres() if options.postgres else None
    with tempfile.TemporaryDirectory() as temporary:
        work = pathlib.Path(temporary)
        rig = Rig(work, options.size, postgres.connection if postgres else "")
        try:
            plan, nowhere = work / "plan.txtpb", work / "nowhere.txtpb"
            plan.write_text(options.plan.read_text().replace("retries: 10", "") + "\nretries: 100\n")
            nowhere.write_text(plan.read_text().replace('"back"', '"nowhere"'))
            alone = []
            rig.run("queue", "start")
            for number in range(_ALONE):
                began = time.monotonic()
                rig.run("queue", "add", str(plan), "--session", f"alone-{number}", "--solve")
                rig.until_ended(number + 1, 600.0)
                alone.append(time.monotonic() - began)
            expected = (options.items - 1) * statistics.median(alone)
            rig.run("queue", "pause")
            half = options.items // 2
            again = ("--solve", "--retries", "20", "--retry-wait", "2")
            rig.run("queue", "add", str(plan), "--session", "vase-{item}", "--times", str(half), *again)
            rig.run("queue", "add", str(nowhere), "--session", "impossible", *again)
            rig.run("queue", "add", str(plan), "--session", "vase-{item}", "--times", str(options.items - 1 - half), *again)
            rig.run("queue", "start")  # no client from here on, but for looking
            began = time.monotonic()
            killed = kill_all_twice(rig, 0.5 * expected, random.Random(options.seed))  # solves overlap captures
            rig.until_ended(_ALONE + options.items, 3.0 * expected + 600.0)
            took = time.monotonic() - began
            done, failed = check(rig, options.items)
        finally:
            rig.close()
            if postgres:
                postgres.close()
    print(f"{options.items} items: {done} done, {len(failed)} failed ({'; '.join(failed)}); nothing twice")
    print(f"an item alone {statistics.median(alone):.1f} s (of {', '.join(f'{each:.1f}' for each in alone)}); all {took:.1f} s, the sum {expected:.1f} s")
    print(f"killed: {', '.join(f'{name} {count}' for name, count in killed.items())}; load {os.getloadavg()[0]:.1f}")
    row("a night's queue over the sum of its items", took / expected, "x")
    return 0 if done == options.items - 1 and len(failed) == 1 else 1


if __name__ == "__main__":
    sys.exit(main())
