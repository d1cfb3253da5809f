"""Power cuts: records every change that a daemon makes to its files, rebuilds its directory as a disk may
hold it after a cut at any point of that record, and starts the daemon on it.

Of the changes that were not flushed at the cut, a disk may hold all, none, or the names without the bytes;
each is tried. As in POSIX, a file's bytes are durable after fsync of the file, its name after fsync of the
directory. Files of SQLite are an exception: their fsync also makes their name durable. SQLite relies on this
for its log, and ext4, xfs and btrfs guarantee it.
"""

from __future__ import annotations

import os
import pathlib
import shutil

import grpc

from glasswing.v1 import archive_service_pb2 as archives
from glasswing.v1 import session_service_pb2 as sessions

import shim
from case import Cases, Lost, Report
from daemon import Daemon, free_port
from lab import Lab, dial, until
from ledger import digest, fetch_matte
from shim import Change
from stage import Stage

case: Cases[Stage] = Cases()

_CUTS = 40  # for each daemon, each in three ways


class Disk:
    """The tree below `root`: as processes see it, and the durable part of it."""

    def __init__(self, root: str) -> None:
        self._root = root
        self._bytes: dict[int, bytearray] = {}  # by inode
        self._flushed: dict[int, bytes] = {}
        self._names: dict[str, int] = {}  # files: path to inode
        self._directories: set[str] = {root}
        self._lasting_names: dict[str, int] = {}
        self._lasting_directories: set[str] = {root}
        self._made = 0

    def apply(self, change: Change) -> None:
        """Applies the next change."""
        path = change.path
        if change.call == "mkdir":
            self._directories.add(path)
        elif change.call == "create":
            self._create(path)
        elif change.call == "write":
            content = self._bytes[self._number(path)]
            if len(content) < change.offset:
                content.extend(bytes(change.offset - len(content)))
            content[change.offset : change.offset + len(change.content)] = change.content
        elif change.call == "truncate":
            content = self._bytes[self._number(path)]
            del content[change.offset :]
            content.extend(bytes(change.offset - len(content)))
        elif change.call == "rename":
            self._rename(path, change.other)
        elif change.call == "unlink":
            self._names.pop(path, None)
        elif change.call == "rmdir":
            self._directories.discard(path)
        elif change.call == "fsync":
            self._flush(path)

    def _create(self, path: str) -> int:
        self._made += 1
        self._bytes[self._made] = bytearray()
        self._flushed[self._made] = b""
        self._names[path] = self._made
        return self._made

    def _number(self, path: str) -> int:
        found = self._names.get(path)
        return self._create(path) if found is None else found

    def _rename(self, path: str, other: str) -> None:
        if path in self._names:
            self._names[other] = self._names.pop(path)
            return
        inside = path + "/"
        for name in [name for name in self._names if name.startswith(inside)]:
            self._names[other + name[len(path) :]] = self._names.pop(name)
        for name in [name for name in self._directories if name == path or name.startswith(inside)]:
            self._directories.discard(name)
            self._directories.add(other + name[len(path) :])

    def _flush(self, path: str) -> None:
        if path not in self._directories:
            number = self._number(path)
            self._flushed[number] = bytes(self._bytes[number])
            if ".sqlite" in path:
                self._lasting_names[path] = number
            return
        inside = {name: number for name, number in self._names.items() if os.path.dirname(name) == path}
        for name in [name for name in self._lasting_names if os.path.dirname(name) == path]:
            del self._lasting_names[name]
        self._lasting_names.update(inside)
        for name in [name for name in self._lasting_directories if os.path.dirname(name) == path and name not in self._directories]:
            self._lasting_directories.discard(name)
        self._lasting_directories.update(name for name in self._directories if os.path.dirname(name) == path)

    def write(self, directory: pathlib.Path, way: str) -> None:
        """Writes the tree as it may be found after a cut: `all`, `names` (without unflushed bytes) or
        `flushed` only."""
        names, folders = (self._lasting_names, self._lasting_directories) if way == "flushed" else (self._names, self._directories)
        shutil.rmtree(directory, ignore_errors=True)
        for folder in sorted(folders):
            if os.path.dirname(folder) in folders or folder == self._root:
                (directory / os.path.relpath(folder, self._root)).mkdir(parents=True, exist_ok=True)
        for name, number in names.items():
            target = directory / os.path.relpath(name, self._root)
            if target.parent.is_dir() and not name.endswith("-shm"):
                target.write_bytes(bytes(self._bytes[number]) if way == "all" else self._flushed[number])


class Acknowledged:
    """What was acknowledged, each with the length of the record at that time."""

    def __init__(self, log: pathlib.Path) -> None:
        self._log = log
        self.frames: list[tuple[int, str, str, str]] = []
        self.sessions: list[tuple[int, str]] = []
        self.mattes: list[tuple[int, str, str]] = []
        self.deletions: list[tuple[int, str]] = []

    def mattes_at(self, cut_at: int, name: str) -> set[str]:
        """The mattes that the session may have after the cut: the last acknowledged one, or one not yet
        acknowledged."""
        before = [known for at, session, known in self.mattes if session == name and at <= cut_at]
        return {*before[-1:], *(known for at, session, known in self.mattes if session == name and at > cut_at)}

    def now(self) -> int:
        """The current length of the record."""
        return self._log.stat().st_size if self._log.exists() else 0


def _recorded(daemon: Daemon, root: pathlib.Path, log: pathlib.Path) -> None:
    """Starts it anew, with every change of its files from the first written down."""
    daemon.end()
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir()
    daemon.environment = shim.environment(root, LOG=str(log))
    daemon.start()


def _cuts(changes: list[Change]) -> list[int]:
    """The cuts, as numbers of changes before each: evenly over the record, and right after calls that
    commit."""
    commits = [number + 1 for number, change in enumerate(changes) if change.call in ("fsync", "rename")]
    chosen = commits[:: max(len(commits) // (_CUTS // 2), 1)]
    chosen += list(range(0, len(changes), max(len(changes) // (_CUTS // 2), 1)))
    return sorted(set(chosen))


@case(f"a power cut of the camera node's machine at some {_CUTS} places, each in three ways", "acknowledged frames are there")
def camera_power_cut(stage: Stage) -> Report:
    """While two archives are written and sealed, and one of them is deleted."""
    work = stage.work / "power-camera"
    work.mkdir()
    log, root = work / "log", work / "camera"
    lab = _CameraLab(stage, work, root)
    acknowledged = Acknowledged(log)
    _recorded(lab.daemon, root, log)
    lab.wait()
    for name in ("one", "two"):
        lab.create(name)
        for frame, content in list(zip(stage.captured.frames, stage.captured.files))[:8]:
            lab.put(name, frame, content)
            acknowledged.frames.append((acknowledged.now(), name, frame.file, digest(content)))
        lab.seal(name)
    acknowledged.deletions.append((acknowledged.now(), "two"))
    lab.delete("two")
    lab.daemon.end()
    changes = shim.read_log(log)
    lab.daemon.environment = {}
    tried = _replay(changes, root, lambda cut_at: lab.look(acknowledged, cut_at))
    lab.close()
    return Report(tried, f"{len(changes)} changes")


class _CameraLab:
    """A camera node with its own data directory, and no other daemon."""

    def __init__(self, stage: Stage, work: pathlib.Path, root: pathlib.Path) -> None:
        self._stage = stage
        self._root = root
        self._port = free_port()
        options = ["--listen", f"127.0.0.1:{self._port}", "--server", stage.lab.address, "--data", str(root), "--name", "power", "--scene", "none"]
        self.daemon = Daemon("camera under power cuts", ["glasswing-camera", *options], work / "camera.log")
        self._channel = dial(self._port)
        self.archives = type(stage.lab.archives)(self._channel)

    def wait(self) -> None:
        """Waits until it answers."""

        def answers() -> bool:
            try:
                self.archives.GetSpace(archives.GetSpaceRequest(), timeout=2.0)
            except grpc.RpcError:
                return False
            return True

        until(answers, "the camera node answers", 20.0)

    def create(self, name: str) -> None:
        header = type(self._stage.captured.header)()
        header.CopyFrom(self._stage.captured.header)
        header.session = name
        self.archives.CreateArchive(archives.CreateArchiveRequest(manifest=header), timeout=20.0)

    def put(self, name: str, frame: object, content: bytes) -> None:
        messages = [archives.PutFrameRequest(session=name, frame=frame), archives.PutFrameRequest(chunk=content)]  # type: ignore[arg-type]
        self.archives.PutFrame(iter(messages), timeout=20.0)

    def seal(self, name: str) -> None:
        self.archives.SealArchive(archives.SealArchiveRequest(session=name), timeout=20.0)

    def delete(self, name: str) -> None:
        self.archives.DeleteArchive(archives.DeleteArchiveRequest(session=name), timeout=20.0)

    def look(self, acknowledged: Acknowledged, cut_at: int) -> None:
        """Starts the node, and checks that it has everything acknowledged before the cut."""
        deleted = {name for at, name in acknowledged.deletions if at <= cut_at}
        self.daemon.start()
        try:
            self.wait()
            for at, session, file, known in acknowledged.frames:
                if at > cut_at or session in deleted:
                    continue
                try:
                    content = b"".join(part.chunk for part in self.archives.ReadFile(archives.ReadFileRequest(session=session, file=file), timeout=20.0))
                except grpc.RpcError as error:
                    raise Lost(f'frame {file} of "{session}" was acknowledged before the cut: {error.details()}') from None
                if digest(content) != known:
                    raise Lost(f'frame {file} of "{session}" differs after the cut')
        finally:
            self.daemon.kill()

    def close(self) -> None:
        self._channel.close()


def _replay(changes: list[Change], root: pathlib.Path, look: object) -> int:
    """Calls `look` after each cut in each way. Returns how often."""
    assert callable(look)
    disk = Disk(os.path.realpath(root))
    cuts = _cuts(changes)
    done = tried = 0
    for cut in cuts:
        for change in changes[done:cut]:
            disk.apply(change)
        done = cut
        cut_at = changes[cut - 1].end if cut else 0
        for way in ("all", "names", "flushed"):
            disk.write(root, way)
            try:
                look(cut_at)
            except Lost as what:
                raise Lost(f"cut after change {cut} of {len(changes)}, with {way}: {what}") from None
            tried += 1
    return tried


@case(f"a power cut of the server's machine at some {_CUTS} places, each in three ways", "acknowledged sessions and mattes are there")
def server_power_cut(stage: Stage) -> Report:
    """While sessions are imported, solved, annotated and deleted. The camera node and the solver keep
    running."""
    work = stage.work / "power-server"
    work.mkdir()
    own = Stage(work, stage.archive, ("--least-tile", "0.05"))
    own.ledger = _Silent(own.lab)  # type: ignore[assignment]
    log, root = work / "log", own.lab.data
    acknowledged = Acknowledged(log)
    _recorded(own.lab.server, root, log)
    until(own.answers, "server and camera node answer", 30.0)
    until(own.lab.camera_is_up, "the camera is known", 30.0)
    for name in ("one", "two"):
        own.put(name, timeout=30.0)
        acknowledged.sessions.append((acknowledged.now(), name))
        own.lab.solve(name=name)
        own.lab.wait_until_done(60.0, name)
        matte = fetch_matte(own.lab, name)
        acknowledged.mattes.append((acknowledged.now(), name, digest(matte)))
        own.lab.sessions.AnnotateSession(sessions.AnnotateSessionRequest(name=name, note=f"note of {name}"), timeout=10.0)
    own.lab.solve(name="one")  # a second time
    own.lab.wait_until_done(60.0, "one")
    acknowledged.mattes.append((acknowledged.now(), "one", digest(fetch_matte(own.lab, "one"))))
    acknowledged.deletions.append((acknowledged.now(), "two"))
    own.lab.sessions.DeleteSession(sessions.DeleteSessionRequest(name="two"), timeout=30.0)
    own.lab.server.end()
    own.lab.server.environment = {}
    changes = shim.read_log(log)
    for solver in own.lab.solvers:
        solver.end()  # so that unfinished solves stay unfinished

    def look(cut_at: int) -> None:
        gone = {name for at, name in acknowledged.deletions if at <= cut_at}
        own.lab.server.start()
        try:
            until(own.answers, "the server answers", 20.0)
            listed = {session.name for session in own.lab.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=10.0).sessions}
            for at, name in acknowledged.sessions:
                if at <= cut_at and name not in gone and name not in listed:
                    raise Lost(f'session "{name}" was acknowledged before the cut')
            for name in {name for at, name, _ in acknowledged.mattes if at <= cut_at} - gone:
                try:
                    now = digest(fetch_matte(own.lab, name))
                except grpc.RpcError as error:
                    raise Lost(f'the matte of "{name}" was fetched before the cut: {error.details()}') from None
                if now not in acknowledged.mattes_at(cut_at, name):
                    raise Lost(f'the matte of "{name}" differs after the cut')
        finally:
            own.lab.server.kill()

    tried = _replay(changes, root, look)
    own.lab.camera.end()
    return Report(tried, f"{len(changes)} changes")


class _Silent:
    """A ledger that records and checks nothing."""

    def __init__(self, lab: Lab) -> None:
        self._lab = lab

    def __getattr__(self, name: str) -> object:
        return lambda *_: None
