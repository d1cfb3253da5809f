"""Live composites: the object in front of another picture, as the camera sees it."""

from __future__ import annotations

import contextlib
import dataclasses
import queue
import time
from collections.abc import Callable, Generator, Iterator, Mapping
from typing import Any

import grpc
import numpy as np
import numpy.typing as npt

from glasswing import pictures
from glasswing.connection import CHUNK_BYTES, Connection
from glasswing.errors import Unavailable
from glasswing.v1 import clock_service_pb2, live_service_pb2, rig_service_pb2
from glasswing.v1.clock_service_pb2_grpc import ClockServiceStub
from glasswing.v1.live_service_pb2_grpc import LiveServiceStub
from glasswing.v1.rig_service_pb2_grpc import RigServiceStub

_SECONDS = 86400.0
_CHECK_SECONDS = 1.0


@dataclasses.dataclass(frozen=True)
class LiveComposite:
    """A composite of one camera frame. Notebooks show it."""

    codes: npt.NDArray[np.uint8] = dataclasses.field(repr=False)
    """H x W x 3, 8-bit sRGB."""
    object_pixels: int
    flagged_pixels: int
    solve_ms: float
    """From the whole frame's arrival at the solver to the composite."""
    frames_passed_over: int
    """Frames skipped by the solver since it began."""

    def _repr_png_(self) -> bytes:
        return pictures.encode_png8(self.codes)


class _Questions:
    """The requests of a bidirectional call, one at a time."""

    def __init__(self) -> None:
        self._requests: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def __iter__(self) -> Iterator[Any]:
        return iter(self._requests.get, None)

    def put(self, request: Any) -> None:
        self._requests.put(request)

    def end(self) -> None:
        self._requests.put(None)


class _Ramp:
    """Makes the server show the ramp, which holds the rig, until closed."""

    def __init__(self, connection: Connection, monitor: str, camera: str) -> None:
        self._connection = connection
        self._questions = _Questions()
        self._object = False
        self._asked = time.monotonic()
        stub = connection.stub(RigServiceStub)
        self._call: Any = stub.ShowRamp(iter(self._questions), timeout=_SECONDS, metadata=connection.metadata())
        self.shown = self._ask(rig_service_pb2.ShowRampRequest(monitor=monitor, camera=camera))

    def close(self) -> None:
        self._questions.end()
        self._call.cancel()

    def bring_object(self) -> None:
        self._object = True
        self.shown = self._ask(rig_service_pb2.ShowRampRequest(object=True))

    def check(self) -> None:
        """Raises if the ramp is no longer shown. Asks the server only occasionally."""
        if time.monotonic() - self._asked > _CHECK_SECONDS:
            self._ask(rig_service_pb2.ShowRampRequest(object=self._object))

    def _ask(self, request: rig_service_pb2.ShowRampRequest) -> rig_service_pb2.ShowRampResponse:
        self._questions.put(request)
        try:
            answer: rig_service_pb2.ShowRampResponse = next(self._call)
        except grpc.RpcError as error:
            raise self._connection.error_of(error) from None
        except StopIteration:
            raise Unavailable(f"{self._connection.title} stopped showing the ramp") from None
        self._asked = time.monotonic()
        return answer


def composites(
    connection: Connection,
    background: npt.ArrayLike,
    *,
    monitor: str,
    camera: str,
    exposure_ms: float,
    options: Mapping[str, str],
    ask: Callable[[str], object],
) -> Generator[LiveComposite, None, None]:
    """See ``Rig.live``."""
    with contextlib.ExitStack() as stack:
        ramp = _Ramp(connection, monitor, camera)
        stack.callback(ramp.close)
        shown = ramp.shown
        if shown.needs_operator:
            ask("Take the object off the stage")
        clock = connection.to(shown.camera_address, "camera node")
        stack.callback(clock.close)
        solver = connection.to(shown.solver_address, "solver")
        stack.callback(solver.close)
        start = live_service_pb2.LiveStart(
            camera_address=shown.camera_address, exposure_ms=exposure_ms, monitor=shown.monitor, options=dict(options)
        )
        if shown.HasField("camera_calibration"):
            start.camera_calibration.CopyFrom(shown.camera_calibration)
        questions = _Questions()
        stack.callback(questions.end)
        questions.put(live_service_pb2.RunLiveRequest(start=start))
        fitted = pictures.resized(background, shown.monitor.width_px, shown.monitor.height_px)
        for request in _picture_requests(pictures.encode_png8(pictures.linear_to_srgb(fitted))):
            questions.put(request)
        answers = solver.stream(solver.stub(LiveServiceStub).RunLive, iter(questions), _SECONDS)
        stack.callback(answers.close)
        frames = _frames(answers, ramp, clock, ask)
        for frame, codes in frames:
            yield LiveComposite(
                codes, frame.object_pixel_count, frame.flagged_pixel_count, frame.solve_ms, frame.frames_passed_over
            )
            ramp.check()


def _picture_requests(png: bytes) -> Iterator[live_service_pb2.RunLiveRequest]:
    for at in range(0, len(png), CHUNK_BYTES):
        ends = at + CHUNK_BYTES >= len(png)
        yield live_service_pb2.RunLiveRequest(picture=png[at : at + CHUNK_BYTES], picture_ends=ends)


def _frames(
    answers: Iterator[live_service_pb2.RunLiveResponse], ramp: _Ramp, clock: Connection, ask: Callable[[str], object]
) -> Iterator[tuple[live_service_pb2.LiveFrame, npt.NDArray[np.uint8]]]:
    """Frames fully exposed with the object."""
    frame = live_service_pb2.LiveFrame()
    codes = b""
    brought_ns: int | None = None  # by the camera node's clock
    for answer in answers:
        if not answer.HasField("frame"):
            if answer.empty_frames_left > 0 or brought_ns is not None:
                continue
            ramp.bring_object()
            if ramp.shown.needs_operator:
                ask("The empty stage is known. Bring the object")
            now: clock_service_pb2.ExchangeResponse = clock.call(
                clock.stub(ClockServiceStub).Exchange, clock_service_pb2.ExchangeRequest()
            )
            brought_ns = now.sent_ns
            continue
        if answer.frame.HasField("taken"):
            frame, codes = answer.frame, b""
        codes += answer.frame.picture
        shape = (frame.taken.height_px, frame.taken.width_px, 3)
        if brought_ns is None or len(codes) < shape[0] * shape[1] * 3 or frame.taken.exposure_start_ns < brought_ns:
            continue
        yield frame, np.frombuffer(codes, np.uint8).reshape(shape)
