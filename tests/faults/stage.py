"""The subject of the faults: a lab with one session imported and solved, and frames from which to make
more."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Callable

import grpc
from google.protobuf import json_format

from glasswing.v1 import archive_pb2, archive_service_pb2 as archives
from glasswing.v1 import session_service_pb2 as sessions

from daemon import Daemon
from lab import SESSION, Lab, glasswing, until
from ledger import Ledger, fetch_matte

_CHUNK = 1 << 20


class Captured:
    """An exported archive: its header, and the record and file of each frame."""

    def __init__(self, directory: pathlib.Path) -> None:
        content = json.loads((directory / "manifest.json").read_text())
        self.header = json_format.ParseDict({key: value for key, value in content.items() if key != "frames"}, archive_pb2.CaptureManifest(), ignore_unknown_fields=True)
        self.frames = [json_format.ParseDict(frame, archive_pb2.Frame()) for frame in content["frames"]]
        self.files = [(directory / frame.file).read_bytes() for frame in self.frames]


class Stage:
    """A lab with its ledger, which records everything acknowledged; `check()` verifies it."""

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

    def exported(self) -> pathlib.Path:
        """The lab's session as an archive, exported once."""
        directory = self.work / "exported"
        if not directory.exists():
            glasswing(self.lab.address, "export", SESSION, str(directory))
        return directory

    def name(self) -> str:
        """A name that no session has yet."""
        self._made += 1
        return f"s{self._made}"

    def put(self, name: str, count: int | None = None, timeout: float = 60.0) -> None:
        """Imports the captured frames, or the first `count`, as a new session. Records what is
        acknowledged."""
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
            self.ledger.captured(name)

    def annotate(self, name: str, note: str) -> None:
        """Sets the session's note, and records it once it is acknowledged."""
        self.lab.sessions.AnnotateSession(sessions.AnnotateSessionRequest(name=name, note=note), timeout=20.0)
        self.ledger.note(name, note)

    def put_frame(self, session: str, frame: archive_pb2.Frame, content: bytes, timeout: float = 60.0, begun: Callable[[], None] = lambda: None) -> None:
        """Uploads one frame, and records it once it is acknowledged. `begun` is called when a part is sent."""

        def messages() -> object:
            yield archives.PutFrameRequest(session=session, frame=frame)
            begun()
            for at in range(0, len(content), _CHUNK):
                yield archives.PutFrameRequest(chunk=content[at : at + _CHUNK])

        self.lab.archives.PutFrame(messages(), timeout=timeout)
        self.ledger.frame(session, frame.file, content)

    def solve(self, name: str) -> None:
        """Solves the session to its end, and records the matte."""
        self.lab.solve(name=name)
        self.lab.wait_until_done(120.0, name)
        self.ledger.matte(name, fetch_matte(self.lab, name))

    def delete(self, name: str) -> None:
        """Deletes the session. Records first that it may be gone, then that it is."""
        self.ledger.forget(name)
        self.lab.sessions.DeleteSession(sessions.DeleteSessionRequest(name=name), timeout=60.0)
        self.ledger.deleted(name)

    def answers(self, timeout: float = 2.0) -> bool:
        """True if server and camera node answer. Calls that fail at once would not see a daemon that has just
        started: gRPC looks at its connections while calls wait, and otherwise every five seconds."""
        try:
            self.lab.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=timeout, wait_for_ready=True)
            self.lab.archives.GetSpace(archives.GetSpaceRequest(), timeout=timeout, wait_for_ready=True)
        except grpc.RpcError:
            return False
        return True

    def revive(self) -> None:
        """Restarts dead daemons until server and camera node answer. A daemon may be found dead only after
        its connections broke."""

        def all_answer() -> bool:
            for daemon in self.lab.daemons():
                if not daemon.is_running():
                    daemon.start()
            return self.answers()

        until(all_answer, "server and camera node answer", 30.0)

    def check(self) -> None:
        """Checks that all daemons run and answer, and that nothing acknowledged is lost. A daemon that died
        by itself is a failure, also if it was restarted since."""
        for daemon in self.lab.daemons():
            assert daemon.is_running(), f"{daemon.name} has died (always.alive):\n{daemon.last_words()}"
            assert not daemon.unasked_ends(), f"{daemon.name} ended by itself with status {daemon.unasked_ends()} (always.alive)"
        until(self.answers, "server and camera node answer", 30.0)
        self.ledger.check()

    def close(self) -> None:
        """Ends all processes."""
        self.lab.close()


def memory_mb(daemon: Daemon) -> float:
    """Resident memory."""
    pages = int(pathlib.Path(f"/proc/{daemon.pid}/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def descriptors(daemon: Daemon) -> int:
    """The number of open file descriptors."""
    return len(list(pathlib.Path(f"/proc/{daemon.pid}/fd").iterdir()))
