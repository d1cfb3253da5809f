"""What faults are done to: a lab with one session imported and solved, and frames to make more of."""

from __future__ import annotations

import json
import pathlib

import grpc
from google.protobuf import json_format

from glasswing.v1 import archive_pb2, archive_service_pb2 as archives
from glasswing.v1 import session_service_pb2 as sessions

from daemon import Daemon
from lab import SESSION, Lab, until
from ledger import Ledger, fetch_matte

_CHUNK = 1 << 20


class Captured:
    """An exported archive: the header, and each frame's record and file."""

    def __init__(self, directory: pathlib.Path) -> None:
        content = json.loads((directory / "manifest.json").read_text())
        self.header = json_format.ParseDict({key: value for key, value in content.items() if key != "frames"}, archive_pb2.CaptureManifest(), ignore_unknown_fields=True)
        self.frames = [json_format.ParseDict(frame, archive_pb2.Frame()) for frame in content["frames"]]
        self.files = [(directory / frame.file).read_bytes() for frame in self.frames]


class Stage:
    """`ledger` knows all that was acknowledged; `check()` holds everything against it."""

    def __init__(self, work: pathlib.Path, archive: pathlib.Path, server_options: tuple[str, ...] = (), solvers: int = 1) -> None:
        work.mkdir(parents=True, exist_ok=True)
        self.work = work
        self.archive = archive
        self.captured = Captured(archive)
        self.lab = Lab(work, {}, server_options)
        self.ledger = Ledger(self.lab)
        self._made = 0
        for _ in range(solvers):
            self.lab.add_solver().start()
        self.put(SESSION)
        self.solve(SESSION)

    def name(self) -> str:
        """Of a session that is not there yet."""
        self._made += 1
        return f"s{self._made}"

    def put(self, name: str, count: int | None = None, timeout: float = 60.0) -> None:
        """Makes a session of the captured frames, or the first of them, and enters what is acknowledged."""
        header = archive_pb2.CaptureManifest()
        header.CopyFrom(self.captured.header)
        header.session = name
        begin = sessions.BeginImportRequest(name=name, manifest=header)
        self.lab.sessions.BeginImport(begin, timeout=timeout)
        self.ledger.session(name)
        create = archives.CreateArchiveRequest(manifest=header)
        self.lab.archives.CreateArchive(create, timeout=timeout)
        for frame, content in list(zip(self.captured.frames, self.captured.files))[:count]:
            self.put_frame(name, frame, content, timeout)
        if count is None:
            self.lab.sessions.FinishImport(sessions.FinishImportRequest(name=name), timeout=timeout)

    def put_frame(self, session: str, frame: archive_pb2.Frame, content: bytes, timeout: float = 60.0) -> None:
        """One, entered once it is acknowledged."""

        def messages() -> object:
            yield archives.PutFrameRequest(session=session, frame=frame)
            for at in range(0, len(content), _CHUNK):
                yield archives.PutFrameRequest(chunk=content[at : at + _CHUNK])

        self.lab.archives.PutFrame(messages(), timeout=timeout)
        self.ledger.frame(session, frame.file, content)

    def solve(self, name: str) -> None:
        """To its end, and enters the matte."""
        self.lab.solve(name=name)
        self.lab.wait_until_done(120.0, name)
        self.ledger.matte(name, fetch_matte(self.lab, name))

    def delete(self, name: str) -> None:
        """Enters that it may be gone, then that it is."""
        self.ledger.forget(name)
        self.lab.sessions.DeleteSession(sessions.DeleteSessionRequest(name=name), timeout=60.0)
        self.ledger.deleted(name)

    def answers(self) -> bool:
        """Server and camera node do."""
        try:
            self.lab.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=2.0)
            self.lab.archives.GetSpace(archives.GetSpaceRequest(), timeout=2.0)
        except grpc.RpcError:
            return False
        return True

    def revive(self) -> None:
        """Starts what has died, also what is found dead a moment after its connections broke, until all answer."""

        def all_answer() -> bool:
            for daemon in self.lab.daemons():
                if not daemon.is_running():
                    daemon.start()
            return self.answers()

        until(all_answer, "server and camera node answer", 30.0)

    def check(self) -> None:
        """Everything runs, answers, and has what it should. A daemon that died unasked is a failure."""
        for daemon in self.lab.daemons():
            assert daemon.is_running(), f"{daemon.name} has died:\n{daemon.last_words()}"
        until(self.answers, "server and camera node answer", 30.0)
        self.ledger.check()

    def close(self) -> None:
        """Ends everything."""
        self.lab.close()


def memory_mb(daemon: Daemon) -> float:
    """Resident."""
    pages = int(pathlib.Path(f"/proc/{daemon.pid}/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def descriptors(daemon: Daemon) -> int:
    """That it has open."""
    return len(list(pathlib.Path(f"/proc/{daemon.pid}/fd").iterdir()))
