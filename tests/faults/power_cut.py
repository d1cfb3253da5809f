"""Power cuts: records every change that a daemon makes to its files, rebuilds its directory as a disk may
hold it after a cut at any point of that record, and starts the daemon on it.

Of the changes that were not flushed at the cut, a disk may hold all, none, or the names without the bytes;
each is tried. As in POSIX, a file's bytes are durable after fsync of the file, its name after fsync of the
directory. Files of SQLite are an exception: their fsync also makes their name durable. SQLite relies on this
for its log, and ext4, xfs and btrfs guarantee it. After each cut `fsck` looks at what the daemon made of it.
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
import shutil
from collections.abc import Callable

import grpc

from glasswing.v1 import archive_service_pb2 as archives
from glasswing.v1 import session_pb2
from glasswing.v1 import session_service_pb2 as sessions

import shim
from case import Cases, Lost, Report, struck
from daemon import Daemon, free_port
from fsck import fsck
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

    def is_flushed(self) -> bool:
        """True if a cut would change nothing."""
        lasting = self._names == self._lasting_names and self._directories == self._lasting_directories
        return lasting and all(self._bytes[number] == self._flushed[number] for number in self._names.values())

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


@dataclasses.dataclass(frozen=True)
class Fact:
    """Something acknowledged: `what` (presence, state, note, matte, frame, manifest) of a session, or of one of its
    files, was `value`. `at`: the length of the record at that time."""

    at: int
    what: str
    session: str
    file: str
    value: object


class Acknowledged:
    """Everything acknowledged, in order. `log`: the record of changes."""

    def __init__(self, log: pathlib.Path) -> None:
        self._log = log
        self._facts: list[Fact] = []

    def enter(self, what: str, session: str, value: object, file: str = "") -> None:
        """Enters what was acknowledged just now."""
        at = self._log.stat().st_size if self._log.exists() else 0
        self._facts.append(Fact(at, what, session, file, value))

    def present(self, name: str, cut_at: int, is_there: bool) -> bool:
        """Checks that the session is there if it was acknowledged before the cut, and away if its deletion was.
        Returns True if it must be there: it was not asked to be deleted."""
        known = [fact.value for fact in self._facts if fact.what == "presence" and fact.session == name and fact.at <= cut_at]
        if known and known[-1] == "present" and not is_there:
            raise Lost("power.sessions", f'session "{name}" was acknowledged before the cut and is missing')
        if known and known[-1] == "deleted" and is_there:
            raise Lost("power.sessions", f'session "{name}" was acknowledged as deleted before the cut and is back')
        return bool(known) and known[-1] == "present"

    def check(self, claim: str, what: str, name: str, cut_at: int, read: Callable[[str], object]) -> None:
        """Reads what was acknowledged of the session before the cut, by file: it must be the last acknowledged value,
        or the next, which may have been stored already."""
        facts = [fact for fact in self._facts if (fact.what, fact.session) == (what, name)]
        for file in sorted({fact.file for fact in facts if fact.at <= cut_at}):
            before = [fact.value for fact in facts if fact.file == file and fact.at <= cut_at]
            later = [fact.value for fact in facts if fact.file == file and fact.at > cut_at]
            try:
                now = read(file)
            except grpc.RpcError as error:
                raise Lost(claim, f'{what} {file} of "{name}" was acknowledged before the cut: {error.details()}') from None
            if now not in (before[-1:] + later[:1]):
                raise Lost(claim, f'{what} {file} of "{name}" is {now} after the cut, not {before[-1]}')


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


@case("power.camera", f"a power cut of the camera node's machine at some {_CUTS} places, each in three ways", "acknowledged frames and archives are there, and fsck finds no damage")
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
        acknowledged.enter("presence", name, "present")
        for frame, content in list(zip(stage.captured.frames, stage.captured.files))[:8]:
            lab.put(name, frame, content)
            acknowledged.enter("frame", name, digest(content), frame.file)
        lab.seal(name)
        acknowledged.enter("manifest", name, lab.manifest(name))
    acknowledged.enter("presence", "two", "to be deleted")
    lab.delete("two")
    acknowledged.enter("presence", "two", "deleted")
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
            assert self.daemon.is_running(), f"the camera node has ended:\n{self.daemon.last_words()}"
            try:
                self.archives.GetSpace(archives.GetSpaceRequest(), timeout=2.0, wait_for_ready=True)
            except grpc.RpcError:
                return False
            return True

        until(answers, "the camera node answers", 60.0)

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

    def manifest(self, name: str) -> str:
        """The digest of the archive's manifest, or "" if there is no such archive."""
        try:
            answer = self.archives.GetManifest(archives.GetManifestRequest(session=name), timeout=20.0)
        except grpc.RpcError as error:
            if error.code() == grpc.StatusCode.NOT_FOUND:
                return ""
            raise
        return digest(answer.manifest.SerializeToString(deterministic=True))

    def read(self, name: str, file: str) -> str:
        """The digest of a frame's file."""
        return digest(b"".join(part.chunk for part in self.archives.ReadFile(archives.ReadFileRequest(session=name, file=file), timeout=20.0)))

    def look(self, acknowledged: Acknowledged, cut_at: int) -> None:
        """Starts the node, and checks that it has everything acknowledged before the cut."""
        self.daemon.start()
        try:
            self.wait()
            for name in ("one", "two"):
                if not acknowledged.present(name, cut_at, self.manifest(name) != ""):
                    continue
                acknowledged.check("power.camera", "frame", name, cut_at, lambda file: self.read(name, file))
                acknowledged.check("power.camera", "manifest", name, cut_at, lambda _: self.manifest(name))
        finally:
            self.daemon.kill()

    def close(self) -> None:
        self._channel.close()


def _replay(changes: list[Change], root: pathlib.Path, look: Callable[[int], None]) -> int:
    """Calls `look`, and then fsck, after each cut in each way. Returns how often."""
    disk = Disk(os.path.realpath(root))
    done = tried = unflushed = 0
    for cut in _cuts(changes):
        for change in changes[done:cut]:
            disk.apply(change)
        done = cut
        cut_at = changes[cut - 1].end if cut else 0
        unflushed += not disk.is_flushed()
        for way in ("all", "names", "flushed"):
            disk.write(root, way)
            try:
                look(cut_at)
                damage = fsck(root).damage
                if damage:
                    raise Lost("power.fsck", f"fsck found damage: {damage}")
            except Lost as lost:
                raise Lost(lost.claim, f"cut after change {cut} of {len(changes)}, with {way}: {lost.what}") from None
            tried += 1
    struck(unflushed, "nothing was unflushed at any cut")
    return tried


@case("power.server", f"a power cut of the server's machine at some {_CUTS} places, each in three ways", "acknowledged sessions, their states, notes and mattes are there, and fsck finds no damage")
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
    until(own.answers, "server and camera node answer", 60.0)
    until(own.lab.camera_is_up, "the camera is known", 60.0)

    def solve(name: str) -> None:
        own.lab.solve(name=name)
        acknowledged.enter("state", name, session_pb2.SESSION_STATE_SOLVING)
        own.lab.wait_until_done(120.0, name)
        acknowledged.enter("state", name, session_pb2.SESSION_STATE_DONE)
        acknowledged.enter("matte", name, digest(fetch_matte(own.lab, name)))

    for name in ("one", "two"):
        own.put(name)
        acknowledged.enter("presence", name, "present")
        acknowledged.enter("state", name, session_pb2.SESSION_STATE_CAPTURED)
        solve(name)
        for note in ("first", "second"):
            own.annotate(name, f"{note} note of {name}")
            acknowledged.enter("note", name, f"{note} note of {name}")
    solve("one")  # a second time
    acknowledged.enter("presence", "two", "to be deleted")
    own.lab.sessions.DeleteSession(sessions.DeleteSessionRequest(name="two"), timeout=30.0)
    acknowledged.enter("presence", "two", "deleted")
    own.lab.server.end()
    own.lab.server.environment = {}
    changes = shim.read_log(log)
    for solver in own.lab.solvers:
        solver.end()  # so that unfinished solves stay unfinished

    def answers() -> bool:
        assert own.lab.server.is_running(), f"the server has ended:\n{own.lab.server.last_words()}"
        return own.answers()

    def look(cut_at: int) -> None:
        own.lab.server.start()
        try:
            until(answers, "the server answers", 60.0)
            answer = own.lab.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=30.0)
            listed = {session.name: session for session in answer.sessions}
            for name in ("one", "two"):
                if not acknowledged.present(name, cut_at, name in listed):
                    continue
                acknowledged.check("power.server", "state", name, cut_at, lambda _: listed[name].state)
                acknowledged.check("power.server", "note", name, cut_at, lambda _: listed[name].note)
                acknowledged.check("power.server", "matte", name, cut_at, lambda _: digest(fetch_matte(own.lab, name)))
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
