#!/usr/bin/env python3
"""Captures an object from all sides: one session for each view of a turntable, on a rig with two monitors.

Try it on a simulated rig, whose object does not turn:

    deploy/local-rig up --monitors 2
    export PYTHONPATH=$PWD/build/release/python
    client/python/examples/turntable.py vase --views 4 --turn-command true

The rig is held for the whole series, so that no other client can use it in between. --turn-command turns the table, or a
person does and presses return when it is at rest. While a view is captured, the previous ones are solved. The same command
continues an interrupted series; captured views are not captured again.

Sessions are named SERIES-000, SERIES-001, ... and tagged SERIES and "turntable"; their mattes are written to a directory.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import shlex
import subprocess
import sys

import glasswing
from glasswing import State

ROOT = pathlib.Path(__file__).resolve().parents[3]


class Table:
    """Turns the object: runs a command with the degrees as its last argument, or asks the operator."""

    def __init__(self, command: str | None) -> None:
        self._command = command

    def turn_to(self, degrees: float) -> None:
        if self._command is None:
            input(f"turn the table to {degrees:g} degrees, then press return ")
            return
        subprocess.run([*shlex.split(self._command), f"{degrees:g}"], check=True)


@dataclasses.dataclass(frozen=True)
class View:
    """One session of the series."""

    series: str
    number: int
    count: int

    @property
    def session_name(self) -> str:
        return f"{self.series}-{self.number:03d}"

    @property
    def degrees(self) -> float:
        return 360.0 * self.number / self.count

    @property
    def note(self) -> str:
        return f"view {self.number + 1} of {self.count}, {self.degrees:g} degrees"


def find(rig: glasswing.Rig, view: View, plan: glasswing.Plan) -> glasswing.Session | None:
    """The view's session if an earlier run started it."""
    try:
        session = rig.session(view.session_name)
    except glasswing.NotFound:
        return None
    there = session.info.plan
    # In it, photos have the names of the uploads.
    if there is None or dataclasses.replace(there, photos=plan.photos) != plan:
        raise glasswing.AlreadyExists(f"{view.session_name} has a different plan; choose another name for the series")
    if session.info.note and session.info.note != view.note:
        raise glasswing.AlreadyExists(f"{view.session_name} is {session.info.note}; choose another name for the series")
    return session


def is_captured(session: glasswing.Session) -> bool:
    """True if every step is captured, whether or not it was solved."""
    return session.info.state.rests and session.info.steps_proven == session.info.steps


def wait_for_capture(session: glasswing.Session) -> None:
    """Waits for the capture; if it pauses until the object is placed, asks them and resumes."""
    while True:
        try:
            session.wait()
            return
        except glasswing.Stopped as stopped:
            if stopped.info.state is not State.PAUSED or not sys.stdin.isatty():
                raise
            input(f"{stopped}\npress return to continue ")
            session.resume()


def finish_what_was_begun(rig: glasswing.Rig, views: list[View], plan: glasswing.Plan) -> None:
    """Waits for a capture left running by an earlier run, which occupies the rig."""
    for view in views:
        session = find(rig, view, plan)
        if session is not None and session.info.state is State.CAPTURING:
            wait_for_capture(session)


def capture(rig: glasswing.Rig, view: View, plan: glasswing.Plan, table: Table) -> glasswing.Session:
    """Returns the view's session, and captures it unless it is already captured."""
    session = find(rig, view, plan)
    if session is None:
        table.turn_to(view.degrees)
        session = rig.capture(plan, name=view.session_name)
    elif session.info.state is State.SOLVING or is_captured(session):
        return session
    elif session.info.state.rests:  # paused or failed; a cancelled session refuses
        table.turn_to(view.degrees)
        session.resume()
    session.annotate(note=view.note, add_tags=[view.series, "turntable"])
    wait_for_capture(session)
    return session


def run(arguments: argparse.Namespace) -> None:
    plan = glasswing.Plan.read(arguments.plan)
    table = Table(arguments.turn_command)
    directory = pathlib.Path(arguments.output or arguments.series)
    directory.mkdir(parents=True, exist_ok=True)
    views = [View(arguments.series, number, arguments.views) for number in range(arguments.views)]
    with glasswing.connect(arguments.server) as rig:
        finish_what_was_begun(rig, views, plan)
        sessions = []
        with rig.hold(f"turntable series {arguments.series}"):
            for view in views:
                session = capture(rig, view, plan, table)
                if session.info.state not in (State.SOLVING, State.DONE):
                    session.solve()  # goes on while the next view is captured
                print(f"{session.name}: {view.note}, {session.info.steps} steps", flush=True)
                sessions.append(session)
        for session in sessions:
            info = session.wait()
            path = directory / f"{session.name}.exr"
            session.download(path)
            print(f"{path}: {info.flagged_pixels} of {info.object_pixels} pixels flagged", flush=True)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("series", help="what the sessions' names begin with")
    parser.add_argument("--views", type=int, default=24, metavar="N", help="1 to 999, evenly round (default: 24)")
    parser.add_argument("--plan", default=ROOT / "deploy/plans/two-monitors.txtpb",
                        help="plan for each view (default: %(default)s)")
    parser.add_argument("--turn-command", metavar="COMMAND",
                        help="turns the table; the degrees are its last argument")
    parser.add_argument("-o", "--output", metavar="DIR", help="directory for the mattes (default: SERIES)")
    parser.add_argument("--server", metavar="HOST:PORT",
                        help="address of glasswing-server (default: as for glasswing)")
    arguments = parser.parse_args()
    if not 1 <= arguments.views <= 999:
        parser.error(f"--views is {arguments.views}; it must be 1 to 999")
    return arguments


if __name__ == "__main__":
    try:
        run(parse_arguments())
    except (glasswing.Error, OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"turntable: {error}")
    except (KeyboardInterrupt, EOFError):
        sys.exit("\nturntable: interrupted; captures and solves in progress continue, and the same command continues the series")
