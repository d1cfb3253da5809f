"""The captured frames of a session, as numpy arrays of the camera's codes.

They come from the node that stores the session's archive, or from one with a copy; docs/archive.md has every convention.
"""

from __future__ import annotations

import dataclasses
import math
import os
import pathlib
import shutil
from collections.abc import Callable, Sequence
from typing import TypeVar, overload

import numpy as np
import numpy.typing as npt
from google.protobuf import json_format

from glasswing import _native
from glasswing.connection import LONG_CALL_SECONDS, Connection
from glasswing.errors import AlreadyExists, Damaged, InvalidInput, Refused, Unavailable
from glasswing.pictures import png_of
from glasswing.v1 import archive_pb2, archive_service_pb2
from glasswing.v1.archive_service_pb2_grpc import ArchiveServiceStub

Codes = npt.NDArray[np.uint16]

Answer = TypeVar("Answer")
_READ_SECONDS = 3600.0


@dataclasses.dataclass(frozen=True)
class Frame:
    """One frame. Notebooks show it."""

    step: int
    """Index in the expanded plan, from 0; -1 without a plan."""
    object: bool
    """The object was on the stage."""
    exposure_ms: float
    file: str
    """"frames/000017.tif"."""
    message: archive_pb2.Frame = dataclasses.field(repr=False)
    """The message Frame (proto/glasswing/v1/archive.proto): stimulus, proof, times and more."""
    _read: Callable[[], Codes] = dataclasses.field(repr=False)
    _black: float = dataclasses.field(repr=False)

    def read(self) -> Codes:
        """All pixels: H x W x 3, or H x W for a camera with a mosaic; 65535 is full scale."""
        return self._read()

    def _repr_png_(self) -> bytes:
        codes = self.read()
        if codes.ndim == 2:  # a mosaic: the mean of every four sites, gray
            rows, columns = (side - side % 2 for side in codes.shape)
            quads = codes[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2)
            codes = np.repeat(quads.mean(axis=(1, 3))[..., None], 3, axis=2).astype(np.uint16)
        return png_of((codes / np.float32(65535) - self._black) / (1.0 - self._black))


class Frames(Sequence[Frame]):
    """The frames of a captured session, in the order of its archive; ``Session.frames()`` makes one."""

    def __init__(self, server: Connection, addresses: Sequence[str], session: str) -> None:
        self._server = server
        self._addresses = addresses
        self._session = session
        request = archive_service_pb2.GetManifestRequest(session=session)

        def asked(archive: Connection) -> archive_service_pb2.GetManifestResponse:
            answer: archive_service_pb2.GetManifestResponse = archive.call(
                archive.stub(ArchiveServiceStub).GetManifest, request, LONG_CALL_SECONDS
            )
            return answer

        self.manifest = self._from_any(asked).manifest
        """The message CaptureManifest: camera, monitors, plan and calibrations of the capture."""
        camera = self.manifest.camera
        channels = () if camera.mosaic else (3,)
        self.shape = (camera.height_px, camera.width_px, *channels)
        """Of each frame."""

    def __repr__(self) -> str:
        size = f"{self.shape[1]}x{self.shape[0]}"
        return f"<{len(self)} frames of session {self._session}, {size}>"

    def __len__(self) -> int:
        return len(self.manifest.frames)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[each] for each in range(*index.indices(len(self)))]
        message = self.manifest.frames[index]
        return Frame(
            message.step,
            message.object,
            message.exposure_ms,
            message.file,
            message,
            lambda: self._rows([message.file], 0, self.shape[0]).reshape(self.shape),
            self.manifest.camera.black_level,
        )

    def rows(self, first: int, count: int = 1) -> Codes:
        """``count`` rows of every frame, from row ``first``: frames x rows x W x 3, without the 3 for a mosaic."""
        if not (0 <= first and 0 < count and first + count <= self.shape[0]):
            raise InvalidInput(f"rows {first} to {first + count - 1}; the frames have rows 0 to {self.shape[0] - 1}")
        return self._rows([frame.file for frame in self.manifest.frames], first, count)

    def pixel(self, x: int, y: int) -> Codes:
        """One pixel's values in every frame: frames x 3, or one per frame for a mosaic."""
        if not 0 <= x < self.shape[1]:
            raise InvalidInput(f"x is {x}; the frames have columns 0 to {self.shape[1] - 1}")
        codes: Codes = self.rows(y)[:, 0, x]
        return codes

    def write(self, directory: str | os.PathLike[str]) -> None:
        """Writes an archive, like "glasswing export": manifest and all frames, each checked.

        AlreadyExists: ``directory`` is neither new nor empty. Refused: its disk lacks space. Damaged names the frame that
        does
        not match its checksum.
        """
        target = pathlib.Path(directory).absolute()
        if target.exists() and not (target.is_dir() and not any(target.iterdir())):
            raise AlreadyExists(f"{target} already exists; it must be a new or empty directory")
        partial = target.with_name(f"{target.name}.partial-{os.getpid()}")
        try:
            (partial / "frames").mkdir(parents=True)
            needed, free = sum(frame.size_bytes for frame in self.manifest.frames), shutil.disk_usage(partial).free
            if needed > free:
                raise Refused(f"{target} would take {needed} bytes; its disk has {free} free")
            for frame in self.manifest.frames:
                file = pathlib.PurePosixPath(frame.file)
                if file.parent != pathlib.PurePosixPath("frames") or file.name in ("", "..", "."):
                    raise Damaged(f'session {self._session} names a frame "{frame.file}"; it must be in frames/')
                (partial / "frames" / file.name).write_bytes(self._file(frame))
            text = json_format.MessageToJson(self.manifest, preserving_proto_field_name=True, ensure_ascii=False)
            (partial / "manifest.json").write_text(text, encoding="utf-8")
            partial.rename(target)
        finally:
            shutil.rmtree(partial, ignore_errors=True)

    def _file(self, frame: archive_pb2.Frame) -> bytes:
        request = archive_service_pb2.ReadFileRequest(session=self._session, file=frame.file)

        def read(archive: Connection) -> bytes:
            answers = archive.stream(archive.stub(ArchiveServiceStub).ReadFile, request, _READ_SECONDS)
            return b"".join(answer.chunk for answer in answers)

        content = self._from_any(read)
        if (checksum := f"xxh3:{_native.checksum(content):016x}") != frame.checksum:
            raise Damaged(f"{frame.file} arrived damaged: its checksum is {checksum}, the manifest says {frame.checksum}")
        return content

    def _rows(self, files: Sequence[str], first: int, count: int) -> Codes:
        request = archive_service_pb2.ReadRowsRequest(
            session=self._session, files=files, first_row=first, row_count=count
        )
        shape = (len(files), count, *self.shape[1:])

        def read(archive: Connection) -> Codes:
            room = bytearray(2 * math.prod(shape))
            filled = 0
            for answer in archive.stream(archive.stub(ArchiveServiceStub).ReadRows, request, _READ_SECONDS):
                ends = filled + len(answer.chunk)
                if answer.offset_bytes != filled or ends > len(room) or _native.checksum(answer.chunk) != answer.checksum:
                    raise Damaged(f"rows of session {self._session} arrived damaged from the {archive.title}")
                room[filled:ends] = answer.chunk
                filled = ends
            if filled != len(room):
                raise Damaged(f"the {archive.title} sent {filled} of {len(room)} bytes of session {self._session}'s rows")
            return np.frombuffer(room, "<u2").astype(np.uint16, copy=False).reshape(shape)

        return self._from_any(read)

    def _from_any(self, ask: Callable[[Connection], Answer]) -> Answer:
        """The answer of the first reachable node with the frames."""
        away = Unavailable(f"no node has frames of session {self._session}")
        for address in self._addresses:
            try:
                return ask(self._server.node(address))
            except Unavailable as error:
                away = error
        raise away
