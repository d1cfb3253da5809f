"""A solver that hands in large tiles, many at once."""

from __future__ import annotations

import collections
import re
import signal
import subprocess
import threading
from collections.abc import Iterator
from typing import Any

import grpc

from glasswing.v1 import work_service_pb2 as work
from glasswing.v1.work_service_pb2_grpc import WorkServiceStub

from callers import Memory, Neighbour, case, watched
from case import Report, struck
from daemon import BIN
from lab import dial
from stage import Stage

_MAX_GROWTH_MB = 256.0
_TILES = 8
_MB = 1 << 20
_TILE_MB = 100


class Solver:
    """Claims tiles, and computes none of them."""

    def __init__(self, stage: Stage, name: str) -> None:
        self._stage = stage
        self._name = name
        self._tiles: Any = WorkServiceStub(stage.lab.channel)
        version = subprocess.run([str(BIN / "glasswing"), "--version"], check=True, capture_output=True, text=True, timeout=20.0).stdout.split()[-1]
        self._claim = work.ClaimTileRequest(solver=name, version=version, wait_ms=5000)

    def _claimed(self) -> work.ClaimTileResponse:
        """The server says which versions it wants, one after the other."""
        while True:
            try:
                claimed: work.ClaimTileResponse = self._tiles.ClaimTile(self._claim, timeout=20.0)
                return claimed
            except grpc.RpcError as error:
                wanted = re.search(r'"([a-z]+)"(?: version \d+)?, the server expects version (\d+)', error.details() or "")
                if error.code() != grpc.StatusCode.FAILED_PRECONDITION or wanted is None:
                    raise
                self._claim.method_versions[wanted[1]] = int(wanted[2])

    def lease(self) -> work.TileLease:
        """Of the next tile of rows."""
        claimed = self._claimed()
        if claimed.survey_rows:
            rows = [5.0] * len(claimed.survey_rows)  # so that each row is a tile
            self._tiles.CompleteSurvey(work.CompleteSurveyRequest(lease=claimed.lease, row_seconds=rows, solver=self._name), timeout=20.0)
            claimed = self._claimed()
        struck(claimed.row_count, "there was no tile to claim")
        return claimed.lease

    def hand_in(self, lease: work.TileLease, megabytes: int) -> str:
        """The code of the answer, on a connection of its own."""

        def messages() -> Iterator[work.CompleteTileRequest]:
            yield work.CompleteTileRequest(lease=lease, solver=self._name)
            for _ in range(megabytes):
                yield work.CompleteTileRequest(chunk=bytes(_MB))

        with dial(self._stage.lab.port) as channel:
            try:
                WorkServiceStub(channel).CompleteTile(messages(), timeout=120.0)
                return "OK"
            except grpc.RpcError as error:
                name: str = error.code().name
                return name


@case("callers.tiles", f"{_TILES} tiles of {_TILE_MB} MB at once", "each is read to its end, and refused for its checksum, in bounded memory")
def tiles(stage: Stage) -> Report:
    """Each on a connection of its own."""
    name = stage.name()
    stage.lab.solvers[0].signal(signal.SIGSTOP)
    try:
        stage.put(name)
        stage.lab.solve(name=name)
        solver = Solver(stage, "greedy")
        leases = [solver.lease() for _ in range(_TILES)]
        codes: list[str] = []
        threads = [threading.Thread(target=lambda lease=lease: codes.append(solver.hand_in(lease, _TILE_MB))) for lease in leases]  # type: ignore[misc]
        memory = Memory(stage.lab.server)
        with Neighbour(stage) as neighbour:
            for thread in threads:
                thread.start()
            watched(120.0, memory, lambda: not any(thread.is_alive() for thread in threads))
            for thread in threads:
                thread.join()
    finally:
        stage.lab.solvers[0].signal(signal.SIGCONT)
    assert collections.Counter(codes) == {"DATA_LOSS": _TILES}, codes
    stage.lab.wait_until_done(120.0, name)
    return Report(_TILES, f"{memory.check(_MAX_GROWTH_MB)}; {neighbour.check()}")
