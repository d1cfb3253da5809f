"""The ledger of a soak: all that was acknowledged, and how much that was."""

from __future__ import annotations

from glasswing.v1 import archive_pb2
from glasswing.v1 import archive_service_pb2 as archives
from glasswing.v1 import session_service_pb2 as sessions

from case import Lost
from lab import Lab
from ledger import Ledger, fetch_matte, read_file


class Book(Ledger):
    """Counts what was ever entered; what is deleted meanwhile is no longer held against anything, and still counted."""

    def __init__(self, lab: Lab) -> None:
        super().__init__(lab)
        self.session_count = 0
        self.frame_count = 0
        self.matte_count = 0
        self._rig = lab
        self._checksums: dict[str, dict[str, str]] = {}
        self._proven: dict[str, int] = {}

    def created(self, name: str) -> None:
        """Acknowledged as made."""
        self.session(name)
        self.session_count += 1

    def told(self, session: sessions.Session) -> None:
        """How many steps are proven. A server that was started again counts them when the session is resumed: what is paused is
        held against the camera's frames. Lost: those are of fewer steps than were told; RpcError: the camera does not answer."""
        known = max(self._proven.get(session.name, 0), session.proven_count)
        self._proven[session.name] = known
        if session.state != sessions.SESSION_STATE_PAUSED or known == 0:
            return
        stored = len({frame.step for frame in self._manifest(session.name).frames})
        if stored < known:
            raise Lost(f'session "{session.name}" had {known} proven steps, and frames of {stored} are there')

    def captured(self, session: sessions.Session) -> None:
        """All frames of its manifest. Lost: a proven step has none. RpcError: somebody does not answer, or a frame is not as
        the manifest says."""
        manifest = self._manifest(session.name)
        steps = {frame.step for frame in manifest.frames}
        missing = set(range(session.step_count)) - steps
        if missing:
            raise Lost(f'session "{session.name}" is captured and has no frames of steps {sorted(missing)}')
        contents = {frame.file: read_file(self._rig, session.name, frame.file) for frame in manifest.frames}
        for file, content in contents.items():
            self.frame(session.name, file, content)
        self._checksums[session.name] = {frame.file: frame.checksum for frame in manifest.frames}
        self.frame_count += len(contents)

    def solved(self, name: str) -> bytes:
        """Its matte, entered. RpcError: the server does not answer."""
        content = fetch_matte(self._rig, name)
        self.matte(name, content)
        self.matte_count += 1
        return content

    def forget(self, name: str) -> None:
        """As Ledger's, of its manifest and proofs too."""
        super().forget(name)
        self._checksums.pop(name, None)
        self._proven.pop(name, None)

    def check(self) -> None:
        """Everything that was not deleted. The rig must be whole. Lost: what is not as it was told."""
        super().check()
        for name, known in self._checksums.items():
            if {frame.file: frame.checksum for frame in self._manifest(name).frames} != known:
                raise Lost(f'the manifest of session "{name}" is not what it was when it was captured')

    def _manifest(self, name: str) -> archive_pb2.CaptureManifest:
        manifest: archive_pb2.CaptureManifest = self._rig.archives.GetManifest(archives.GetManifestRequest(session=name), timeout=30.0, wait_for_ready=True).manifest
        return manifest
