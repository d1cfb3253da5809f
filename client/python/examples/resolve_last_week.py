#!/usr/bin/env python3
"""Solves the sessions of the last days, or all with a tag, again with another method or with other options.

First list what would be solved, then solve it:

    export PYTHONPATH=$PWD/build/release/python
    client/python/examples/resolve_last_week.py --set modes=2 --dry-run
    client/python/examples/resolve_last_week.py --set modes=2

Completely captured sessions are solved one after another; calibration sessions are left out. If one cannot be solved, its
previous matte stays and the others continue. A summary lists the failures; the exit status is 0 only if there are
none.
"""

from __future__ import annotations

import argparse
import datetime
import sys
from collections.abc import Mapping

import glasswing
from glasswing import Action, State


def sessions_to_solve(rig: glasswing.Rig, days: float | None, tags: list[str]) -> list[glasswing.Session]:
    """The completely captured sessions, oldest first."""
    since = None if days is None else datetime.datetime.now().astimezone() - datetime.timedelta(days=days)
    found = rig.sessions(tags=tags, since=since, states=[State.CAPTURED, State.DONE, State.FAILED])
    return [session for session in reversed(found) if can_be_solved(session.refresh())]


def can_be_solved(info: glasswing.SessionInfo) -> bool:
    """True if every step was captured and the server would solve it."""
    complete = info.state is not State.FAILED or info.steps_proven == info.steps
    return complete and Action.SOLVE in info.allowed_actions


def how(method: str, options: Mapping[str, str]) -> str:
    """A solve's method and options in words."""
    return " ".join([method or "the plan's method", *(f"{key}={value}" for key, value in sorted(options.items()))])


def solve(session: glasswing.Session, method: str, options: Mapping[str, str]) -> str:
    """Solves the session and returns the result in words."""
    session.solve(method, options)
    info = session.wait()
    return f"{info.flagged_pixels} of {info.object_pixels} pixels flagged, {info.solve_seconds:.1f} s"


def run(arguments: argparse.Namespace) -> int:
    options = dict(arguments.set)
    with glasswing.connect(arguments.server) as rig:
        sessions = sessions_to_solve(rig, arguments.days, arguments.tag)
        failures = {}
        for session in sessions:
            info = session.info
            before = how(info.method, info.options) if info.matte_ready else "not solved"
            line = f"{info.name} ({info.created:%Y-%m-%d}): {before} -> {how(arguments.method, options)}"
            if arguments.dry_run:
                print(line)
                continue
            try:
                print(f"{line}: {solve(session, arguments.method, options)}", flush=True)
            except glasswing.Unavailable:
                raise  # the other sessions would fail too
            except glasswing.Error as error:
                failures[session.name] = str(error)
                print(f"{line}: failed", flush=True)
    if arguments.dry_run:
        print(f"{len(sessions)} sessions would be solved")
        return 0
    print(f"{len(sessions) - len(failures)} of {len(sessions)} sessions were solved")
    for name, reason in failures.items():
        print(f"  {name}: {reason}")
    return 1 if failures else 0


def setting(text: str) -> tuple[str, str]:
    """Parses KEY=VALUE."""
    key, equals, value = text.partition("=")
    if not key or not equals:
        raise argparse.ArgumentTypeError(f"{text} must be KEY=VALUE")
    return key, value


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--days", type=float, help="only sessions of this many last days (default: 7, or any with --tag)")
    parser.add_argument("--tag", action="append", default=[], help="only sessions with this tag; may be repeated")
    parser.add_argument("--method", default="", help="the method (default: each plan's)")
    parser.add_argument("--set", action="append", default=[], type=setting, metavar="KEY=VALUE",
                        help="an option of the method; may be repeated")
    parser.add_argument("--dry-run", action="store_true", help="only list what would be solved")
    parser.add_argument("--server", metavar="HOST:PORT",
                        help="address of glasswing-server (default: as for glasswing)")
    arguments = parser.parse_args()
    if arguments.days is None and not arguments.tag:
        arguments.days = 7.0
    return arguments


if __name__ == "__main__":
    try:
        sys.exit(run(parse_arguments()))
    except glasswing.Error as error:
        sys.exit(f"resolve_last_week: {error}")
    except KeyboardInterrupt:
        sys.exit("\nresolve_last_week: interrupted; solves in progress continue")
