"""The ledger of a soak: records and counts everything acknowledged."""

from __future__ import annotations

from glasswing.v1 import archive_pb2
from glasswing.v1 import archive_service_pb2 as archives
from glasswing.v1 import session_pb2

from case import Lost
from lab import Lab
from ledger import Ledger, fetch_matte, read_file


class Book(Ledger):
    """A ledger that also counts all entries ever made. Deleted sessions are still counted, but no longer
    checked."""

    def __init__(self, lab: Lab) -> None:
        super().__init__(lab)
        self.session_count = 0
        self.frame_count = 0
        self.matte_count = 0
        self._rig = lab
        self._checksums: dict[str, dict[str, str]] = {}
        self._proven: dict[str, int] = {}

    def created(self, name: str) -> None:
        """Enters and counts a session acknowledged as created."""
        self.session(name)
        self.session_count += 1

    def observed(self, session: session_pb2.Session) -> None:
        """Enters the number of proven steps. A restarted server counts them only when the session is resumed,
        so for a paused session this counts the camera's frames. Raises Lost if there are fewer, RpcError if
        the camera does not answer."""
        known = max(self._proven.get(session.name, 0), session.proven_count)
        self._proven[session.name] = known
        if session.state != session_pb2.SESSION_STATE_PAUSED or known == 0:
            return
        stored = len({frame.step for frame in self._manifest(session.name).frames})
        if stored < known:
            raise Lost("soak.lost", f'session "{session.name}" had {known} proven steps, but frames of only {stored} are stored')

    def captured(self, session: session_pb2.Session) -> None:
        """Enters all frames of its manifest. Raises Lost if a step has none; RpcError if the camera does not
        answer, or a frame does not match the manifest."""
        manifest = self._manifest(session.name)
        steps = {frame.step for frame in manifest.frames}
        missing = set(range(session.step_count)) - steps
        if missing:
            raise Lost("soak.lost", f'session "{session.name}" is captured but has no frames of steps {sorted(missing)}')
        contents = {frame.file: read_file(self._rig, session.name, frame.file) for frame in manifest.frames}
        for file, content in contents.items():
            self.frame(session.name, file, content)
        self._checksums[session.name] = {frame.file: frame.checksum for frame in manifest.frames}
        self.frame_count += len(contents)

    def solved(self, name: str) -> bytes:
        """Fetches, enters and returns its matte. RpcError: the server does not answer."""
        content = fetch_matte(self._rig, name)
        self.matte(name, content)
        self.matte_count += 1
        return content

    def forget(self, name: str) -> None:
        """Also drops its manifest and proven steps."""
        super().forget(name)
        self._checksums.pop(name, None)
        self._proven.pop(name, None)

    def check(self) -> None:
        """Checks everything not deleted. All daemons must be up. Raises Lost if something is missing or
        different."""
        super().check()
        for name, known in self._checksums.items():
            if {frame.file: frame.checksum for frame in self._manifest(name).frames} != known:
                raise Lost("soak.lost", f'the manifest of session "{name}" has changed since it was captured')

    def _manifest(self, name: str) -> archive_pb2.CaptureManifest:
        manifest: archive_pb2.CaptureManifest = self._rig.archives.GetManifest(archives.GetManifestRequest(session=name), timeout=30.0, wait_for_ready=True).manifest
        return manifest
