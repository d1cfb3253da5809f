#!/usr/bin/env python3
"""Captures one plan with several exposures, one session each, and reports which gives the best matte.

Try it on a simulated rig, whose camera clips white from 4.5 ms on:

    deploy/local-rig up --fps 100
    export PYTHONPATH=$PWD/build/release/python
    client/python/examples/exposure_sweep.py vase --exposures 1 2 4 8

If an exposure is too long, bright pixels saturate; if it is too short, noise dominates. A matte flags both. The best
exposure has the fewest flagged pixels of the object; among equals it is the longest, which has the least noise.

Sessions are named NAME-1ms, NAME-2ms, ... and tagged "exposure-sweep". If the camera cannot make an exposure or its steps
cannot be proven, the table shows the error and the sweep continues.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import sys

import numpy as np

import glasswing

ROOT = pathlib.Path(__file__).resolve().parents[3]


@dataclasses.dataclass(frozen=True)
class Result:
    """The result of one exposure: counts of the object's pixels, or `error`."""

    exposure_ms: float
    object_pixels: int = 0
    flagged: int = 0
    saturated: int = 0
    error: str = ""

    def __str__(self) -> str:
        if self.error:
            return f"{self.exposure_ms:>9g}  {self.error}"
        return f"{self.exposure_ms:>9g}  {self.object_pixels:>9}  {self.flagged:>9}  {self.saturated:>9}"


HEADING = f"{'ms':>9}  {'object px':>9}  {'flagged':>9}  {'saturated':>9}"


def try_exposure(rig: glasswing.Rig, plan: glasswing.Plan, name: str, exposure_ms: float) -> Result:
    """Captures and solves a session with this exposure, and counts its pixels."""
    try:
        exposed = dataclasses.replace(plan, exposure_ms=[exposure_ms])
        session = rig.capture(exposed, name=f"{name}-{exposure_ms:g}ms")
        session.annotate(add_tags=["exposure-sweep"])
        session.wait()
        session.solve()
        session.wait()
    except (glasswing.InvalidInput, glasswing.Stopped) as error:
        return Result(exposure_ms, error=str(error))
    matte = session.fetch()
    flags = matte.flags[matte.coverage > 0]
    saturated = np.count_nonzero(flags & glasswing.PixelFlag.SATURATED)
    return Result(exposure_ms, flags.size, np.count_nonzero(flags), saturated)


def best_of(results: list[Result]) -> Result:
    """The exposure with the fewest flagged pixels; among equals the longest."""
    solved = [result for result in results if not result.error]
    if not solved:
        raise glasswing.Error("no exposure gave a matte")
    return min(solved, key=lambda result: (result.flagged, -result.exposure_ms))


def run(arguments: argparse.Namespace) -> None:
    plan = glasswing.Plan.read(arguments.plan)
    results = []
    with glasswing.connect(arguments.server) as rig, rig.hold(f"exposure sweep {arguments.name}"):
        print(HEADING)
        for exposure_ms in sorted(set(arguments.exposures)):
            results.append(try_exposure(rig, plan, arguments.name, exposure_ms))
            print(results[-1], flush=True)
    best = best_of(results)
    print(f"best: {best.exposure_ms:g} ms, session {arguments.name}-{best.exposure_ms:g}ms")


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", help="what the sessions' names begin with")
    parser.add_argument("--exposures", type=float, nargs="+", default=[1.0, 2.0, 4.0], metavar="MS",
                        help="in ms (default: 1 2 4)")
    parser.add_argument("--plan", default=ROOT / "deploy/plans/quick.txtpb",
                        help="the plan whose exposure is replaced (default: %(default)s)")
    parser.add_argument("--server", metavar="HOST:PORT",
                        help="address of glasswing-server (default: as for glasswing)")
    return parser.parse_args()


if __name__ == "__main__":
    try:
        run(parse_arguments())
    except glasswing.Error as error:
        sys.exit(f"exposure_sweep: {error}")
    except KeyboardInterrupt:
        sys.exit("\nexposure_sweep: interrupted; the session in progress continues")
