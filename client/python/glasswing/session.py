"""Sessions: a capture, its frames, and the matte solved from them."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import enum
import os
import pathlib
import re
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from glasswing import notebook
from glasswing.connection import LONG_CALL_SECONDS, Connection
from glasswing.errors import Error, InvalidInput, Refused, TimedOut
from glasswing.frames import Frames
from glasswing.matte import Matte
from glasswing.plan import Plan
from glasswing.stage import object_to_rig
from glasswing.v1 import plan_pb2, rays_pb2, session_pb2
from glasswing.v1 import session_service_pb2 as pb
from glasswing.v1.session_service_pb2_grpc import SessionServiceStub

_FETCH_SECONDS = 600.0
_COPY_SECONDS = 86400.0
_SHOWN_PIXELS = 40000


def _region(crop: str) -> pb.MatteRegion:
    match = re.fullmatch(r"(\d{1,6})x(\d{1,6})\+(\d{1,6})\+(\d{1,6})", crop, re.ASCII)
    if match is None:
        raise InvalidInput(f'crop is "{crop}"; it must be WIDTHxHEIGHT+X+Y, such as 640x480+100+50')
    width, height, x, y = map(int, match.groups())
    return pb.MatteRegion(x_px=x, y_px=y, width_px=width, height_px=height)


class State(enum.Enum):
    """The state of a session."""

    CREATED = session_pb2.SESSION_STATE_CREATED
    CAPTURING = session_pb2.SESSION_STATE_CAPTURING
    PAUSED = session_pb2.SESSION_STATE_PAUSED
    CAPTURED = session_pb2.SESSION_STATE_CAPTURED
    SOLVING = session_pb2.SESSION_STATE_SOLVING
    DONE = session_pb2.SESSION_STATE_DONE
    FAILED = session_pb2.SESSION_STATE_FAILED
    CANCELLED = session_pb2.SESSION_STATE_CANCELLED
    DAMAGED = session_pb2.SESSION_STATE_DAMAGED

    @property
    def rests(self) -> bool:
        """True if the session stays in this state until somebody intervenes."""
        return self not in (State.CREATED, State.CAPTURING, State.SOLVING)


class Action(enum.Enum):
    """A call that a session's state may allow. RETRY is ``resume()`` of a failed session."""

    PAUSE = session_pb2.SESSION_ACTION_PAUSE
    RESUME = session_pb2.SESSION_ACTION_RESUME
    RETRY = session_pb2.SESSION_ACTION_RETRY
    CANCEL = session_pb2.SESSION_ACTION_CANCEL
    SOLVE = session_pb2.SESSION_ACTION_SOLVE
    FETCH = session_pb2.SESSION_ACTION_FETCH
    REPLICATE = session_pb2.SESSION_ACTION_REPLICATE
    DELETE = session_pb2.SESSION_ACTION_DELETE
    RETAKE = session_pb2.SESSION_ACTION_RETAKE


@dataclasses.dataclass(frozen=True)
class UnprovenStep:
    """A step of a failed capture without proof."""

    step: int
    what: str


@dataclasses.dataclass(frozen=True)
class Waiting:
    """What a session is waiting for, in the server's words."""

    what: str
    """"no solver is running"."""
    since: datetime.datetime | None
    """None: unknown."""
    advice: str
    """What to do."""

    @classmethod
    def from_message(cls, message: session_pb2.Waiting) -> Waiting:
        """Converts a wire message."""
        since = datetime.datetime.fromisoformat(message.since) if message.since else None
        return cls(message.what, since, message.advice)

    def __str__(self) -> str:
        since = f", since {self.since:%Y-%m-%d %H:%M:%S %Z}" if self.since else ""
        return f"{self.what}{since}; {self.advice}"


@dataclasses.dataclass(frozen=True)
class RigChange:
    """A disturbance of the rig during a capture, in the server's words."""

    what: str
    advice: str
    """What to do."""
    seconds: float
    """Seconds of the capture, when it was detected."""
    lost: tuple[range, ...]
    """The steps to capture again (``Session.retake()``); empty: recapturing would not help."""

    @classmethod
    def from_message(cls, message: session_pb2.RigChange) -> RigChange:
        """Converts a wire message."""
        lost = tuple(range(each.first, each.last + 1) for each in message.lost)
        return cls(message.what, message.advice, message.seconds, lost)

    def __str__(self) -> str:
        return f"{self.what}; {self.advice}"


@dataclasses.dataclass(frozen=True)
class Draft:
    """What the newest draft of a session is made from: ``images`` of ``planned``."""

    images: int
    planned: int


@dataclasses.dataclass(frozen=True)
class SessionInfo:
    """A snapshot of a session, also the type of the events of ``Session.events()``.

    Steps are those of the expanded plan, ``tiles`` those of the newest solve, and ``frames`` those of a video (0: the
    session has one matte). ``plan`` is None in lists of sessions.
    """

    name: str
    state: State
    reason: str
    """Why it is paused or failed, and what to do; otherwise empty."""
    waiting: Waiting | None
    """What blocks it; None: nothing."""
    warning: str
    """What makes the capture less reliable; otherwise empty."""
    rig_changes: tuple[RigChange, ...]
    """What happened to the rig during the capture, oldest first."""
    created: datetime.datetime
    started_by: str
    note: str
    tags: tuple[str, ...]
    axes: Mapping[str, float]
    """Where the stage's axes put the object, by name, degrees or mm; empty: unknown."""
    plan: Plan | None
    steps: int
    steps_proven: int
    steps_proven_by_patch: int
    """Those also proven by the id patch."""
    steps_proven_by_time: int
    """Those proven by time alone: false time stamps of a display or the camera would go undetected."""
    steps_retaken: int
    """Steps shown again."""
    frames_refused: int
    """Frames that were on time but showed another id."""
    unproven: tuple[UnprovenStep, ...]
    frames_taken: int
    """Frames from the camera, kept or not."""
    capture_seconds: float
    """Time spent capturing, without pauses."""
    archive_bytes: int
    method: str
    options: Mapping[str, str]
    tiles: int
    tiles_done: int
    solve_seconds: float
    matte_ready: bool
    """True if a matte can be fetched: that of the last finished solve."""
    pixels: int
    object_pixels: int
    """Pixels inside the silhouette, once solved."""
    flagged_pixels: int
    """Unreliable pixels among them."""
    frames: int
    lost_frames: tuple[int, ...]
    solved_frames: tuple[int, ...]
    refused_frames: tuple[int, ...]
    refusal: str
    """Why one of the rejected frames cannot be solved; otherwise empty."""
    matte_warnings: tuple[str, ...]
    """The ``Matte.warnings`` of the mattes, each once."""
    allowed_actions: frozenset[Action]
    """The calls that the server would accept now."""
    draft: Draft | None
    """For a session captured with ``solve``: what ``Session.draft()`` would fetch; None: nothing."""
    copies: tuple[str, ...]
    """Nodes with copies of its frames (``Session.replicate()``)."""
    camera: str
    """Of a view of a session with several cameras: its camera node; otherwise empty."""
    views: tuple[SessionInfo, ...]
    """Of a session with several cameras: those of each camera, which this one sums up (``Session.camera()``)."""

    @classmethod
    def from_message(cls, message: session_pb2.Session) -> SessionInfo:
        """Converts a wire message."""
        return cls(
            name=message.name,
            state=State(message.state),
            reason=message.reason,
            waiting=Waiting.from_message(message.waiting) if message.HasField("waiting") else None,
            warning=message.warning,
            rig_changes=tuple(RigChange.from_message(each) for each in message.rig_changes),
            created=datetime.datetime.fromisoformat(message.created),
            started_by=message.started_by,
            note=message.note,
            tags=tuple(message.tags),
            axes=dict(message.axes),
            plan=Plan.from_message(message.plan) if message.HasField("plan") else None,
            steps=message.step_count,
            steps_proven=message.proven_count,
            steps_proven_by_patch=message.patch_proven_count,
            steps_proven_by_time=message.time_proven_count,
            steps_retaken=message.retaken_count,
            frames_refused=message.refused_count,
            unproven=tuple(UnprovenStep(each.step, each.what) for each in message.unproven),
            frames_taken=message.frames_taken,
            capture_seconds=message.capture_seconds,
            archive_bytes=message.archive_bytes,
            method=message.method,
            options=dict(message.options),
            tiles=message.tile_count,
            tiles_done=message.tiles_done,
            solve_seconds=message.solve_seconds,
            matte_ready=message.matte_ready,
            pixels=message.pixel_count,
            object_pixels=message.object_pixel_count,
            flagged_pixels=message.flagged_pixel_count,
            frames=message.frame_count,
            lost_frames=tuple(message.lost_frames),
            solved_frames=tuple(message.solved_frames),
            refused_frames=tuple(message.refused_frames),
            refusal=message.refusal,
            matte_warnings=tuple(message.matte_warnings),
            allowed_actions=frozenset(map(Action, message.allowed_actions)),
            draft=Draft(message.draft.image_count, message.draft.planned_image_count) if message.HasField("draft") else None,
            copies=tuple(copy.node for copy in message.copies),
            camera=message.view_camera,
            views=tuple(map(cls.from_message, message.views)),
        )

    def __str__(self) -> str:
        line = f"session {self.name} is {self.state.name.lower()}"
        if self.waiting and self.state is not State.PAUSED:  # of a paused one the reason says more
            return f"{line}, and waits: {self.waiting}"
        if self.reason:
            return f"{line}: {self.reason}"
        if self.state is State.SOLVING:
            return f"{line}: {self.tiles_done} of {self.tiles} tiles" if self.tiles else f"{line}: estimating the work"
        if self.state is State.DONE:
            return f"{line}: {self.object_pixels} of {self.pixels} pixels show the object ({self.flagged_pixels} flagged)"
        return f"{line}: {self.steps_proven} of {self.steps} steps, {self.steps_retaken} retaken"


class Stopped(Error):
    """The session was paused, failed or was cancelled while waiting for it; ``info`` has its state."""

    def __init__(self, info: SessionInfo) -> None:
        super().__init__(str(info))
        self.info = info


class Session:
    """A session on the server. ``info`` is its latest known state; ``refresh()`` updates it.

    Every method raises ``NotFound`` once the session is deleted, and ``Refused`` if its state does not allow the call.
    Requesting the state that it already has is not an error.
    """

    def __init__(self, connection: Connection, info: SessionInfo) -> None:
        self._connection = connection
        self._stub = connection.stub(SessionServiceStub)
        self.info = info

    def __repr__(self) -> str:
        return f"<{self.info}>"

    def _repr_html_(self) -> str:
        info = self.info
        rows = [(info.name, info), ("note", info.note), ("tags", ", ".join(info.tags)), ("method", info.method)]
        shown = notebook.table((name, value) for name, value in rows if str(value))
        if info.matte_ready:
            with contextlib.suppress(Error):  # the table alone, then
                frame = info.solved_frames[0] if info.frames and info.solved_frames else None
                request = pb.FetchMatteRequest(name=info.name, frame=frame, max_pixels=_SHOWN_PIXELS)
                shown += notebook.image(Matte.from_bytes(self._matte_bytes(request))._repr_png_())
        return shown

    @property
    def name(self) -> str:
        """The session's name."""
        return self.info.name

    def cameras(self) -> tuple[str, ...]:
        """The names of several cameras, each of which has a session (``camera()``); empty: it has one camera."""
        return tuple(view.camera for view in self.info.views)

    def camera(self, name: str) -> Session:
        """The session of one of several cameras, with its own frames and matte. InvalidInput: it has no such camera."""
        for view in self.info.views:
            if view.camera == name:
                session = Session(self._connection, view)
                session.refresh()  # with its plan
                return session
        cameras = ", ".join(self.cameras()) or "one, which is not named"
        raise InvalidInput(f"session {self.name} has no camera {name}; it has {cameras}")

    def refresh(self) -> SessionInfo:
        """Asks the server for the session's state."""
        return self._ask(self._stub.GetSession, pb.GetSessionRequest(name=self.name), 0.0)

    def events(self) -> Iterator[SessionInfo]:
        """Yields the session now and after every change, until it comes to rest. Leaving the loop does not affect the
        session."""
        return self._events(None)

    def wait(self, timeout: float | None = None, *, retries: int = 0) -> SessionInfo:
        """Waits until the session is captured or done; with ``solve``, until it is done.

        ``retries``: how often it is resumed if it fails. Raises ``Stopped`` if it comes to rest in another state (a session
        that paused until the object is placed can be resumed and waited for again), and ``TimedOut`` after ``timeout``
        seconds.
        """
        ends = None if timeout is None else time.monotonic() + timeout
        for attempt in range(retries + 1):
            for _ in self._events(None if ends is None else max(ends - time.monotonic(), 0.0)):
                pass
            if self.info.state is not State.FAILED or attempt == retries:
                break
            self.resume()
        if self.info.state not in (State.CAPTURED, State.DONE):
            raise Stopped(self.info)
        return self.info

    def pose(self, geometry: rays_pb2.RigGeometry) -> npt.NDArray[np.float64]:
        """The object's pose in this session: ``object_to_rig(geometry, self.info.axes)``."""
        return object_to_rig(geometry, self.info.axes)

    def pause(self) -> SessionInfo:
        """Stops the capture or solve; proven steps and solved tiles are kept."""
        return self._ask(self._stub.PauseSession, pb.PauseSessionRequest(name=self.name))

    def resume(self, retries: int | None = None) -> SessionInfo:
        """Continues a paused session, or retries the failed parts of a failed one.

        ``retries``: how often a step may be shown again from now on; default: the plan's.
        """
        return self._ask(self._stub.ResumeSession, pb.ResumeSessionRequest(name=self.name, retries=retries))

    def retake(self, steps: Iterable[range] | None = None) -> SessionInfo:
        """Drops the frames of these steps and captures them again; a running capture is stopped for this.

        ``steps``: ranges with step 1; default: those that ``rig_changes`` names. InvalidInput: no steps given, or the
        session has no such steps. Refused: it is solved, copied, imported or a video.
        """
        if steps is None:
            steps = [lost for change in self.refresh().rig_changes for lost in change.lost]
        ranges = [plan_pb2.StepRange(first=each.start, last=each.stop - 1) for each in steps if len(each) > 0]
        if not ranges:
            raise InvalidInput(f"session {self.name} has no steps to capture again")
        return self._ask(self._stub.ResumeSession, pb.ResumeSessionRequest(name=self.name, retake=ranges))

    def cancel(self) -> SessionInfo:
        """Ends a capture or a solve for good."""
        return self._ask(self._stub.CancelSession, pb.CancelSessionRequest(name=self.name))

    def solve(self, method: str = "", options: Mapping[str, object] | None = None) -> SessionInfo:
        """Starts a solve of the captured frames; ``wait()`` and ``events()`` follow it.

        ``method``: default: the plan's. ``options``: the method's options, such as ``{"images": 100}`` (docs/methods.md).
        The matte of the previous solve can be fetched until this one is done. InvalidInput: an unknown method or option.
        """
        text = {key: str(value) for key, value in (options or {}).items()}
        return self._ask(
            self._stub.SolveSession, pb.SolveSessionRequest(name=self.name, method=method, options=text)
        )

    def annotate(
        self, note: str | None = None, add_tags: Iterable[str] = (), remove_tags: Iterable[str] = ()
    ) -> SessionInfo:
        """Changes the note (up to 4096 bytes; None leaves it) and the tags ([A-Za-z0-9._-], 1 to 64)."""
        request = pb.AnnotateSessionRequest(
            name=self.name, note=note, add_tags=list(add_tags), remove_tags=list(remove_tags)
        )
        return self._ask(self._stub.AnnotateSession, request)

    def delete(self, trash: bool = False) -> int:
        """Removes the session, its frames and its mattes for good, and returns the number of freed bytes.

        ``trash``: puts it into the server's trash instead, which frees nothing for a day; ``glasswing undelete`` takes it
        back, and its name stays taken.

        Refused: it is being captured, imported or solved. Unavailable: the node with its frames is unreachable; nothing was
        removed.
        """
        request = pb.DeleteSessionRequest(name=self.name, trash=trash)
        answer: pb.DeleteSessionResponse = self._connection.call(
            self._stub.DeleteSession, request, LONG_CALL_SECONDS
        )
        return answer.freed_bytes

    def fetch(self, frame: int | None = None, crop: str | None = None) -> Matte:
        """Fetches the finished matte, or that of one ``frame`` of a video, counted from 0. Refused: it is not solved.

        ``crop``: "WIDTHxHEIGHT+X+Y": only this region of the picture, px from its top-left corner. Invalid: it is not within
        the picture.
        """
        return Matte.from_bytes(self._matte_bytes(self._matte_request(frame, crop)))

    def download(
        self, path: str | os.PathLike[str], frame: int | None = None, crop: str | None = None
    ) -> Matte:
        """Like ``fetch``, and also writes the matte's file (OpenEXR, docs/matte.md) to ``path``."""
        content = self._matte_bytes(self._matte_request(frame, crop))
        matte = Matte.from_bytes(content)
        final = pathlib.Path(path)
        unfinished = final.with_name(f".{final.name}.{os.getpid()}")
        try:
            unfinished.write_bytes(content)
            unfinished.replace(final)
        finally:
            unfinished.unlink(missing_ok=True)
        return matte

    def draft(self) -> Matte:
        """The newest draft of a session that is being captured with ``solve``, or is being solved: from all images, or
        tiles, so far.

        Other pixels are flagged ``PixelFlag.NO_DATA``; ``metadata.draft`` says what it is made from. Refused: nothing is
        solved yet.
        """
        return Matte.from_bytes(self._matte_bytes(pb.FetchMatteRequest(name=self.name, partial=True)))

    def frames(self) -> Frames:
        """The captured frames, as numpy arrays, from the camera node or a node with a copy. NotFound: there are none yet.
        Refused: it has several cameras (``camera()``)."""
        answer: pb.GetSessionResponse = self._connection.call(self._stub.GetSession, pb.GetSessionRequest(name=self.name))
        found = answer.session
        if found.views:
            names = ", ".join(view.view_camera for view in found.views)
            raise Refused(f"session {self.name} has several cameras; choose one with camera(): {names}")
        addresses = [found.archive_address, *(copy.address for copy in found.copies)]
        return Frames(self._connection, [address for address in addresses if address], self.name)

    def export(self, directory: str | os.PathLike[str]) -> None:
        """Writes frames and manifest to a new directory, like "glasswing export"; docs/archive.md describes it.

        AlreadyExists: the directory is neither new nor empty. Refused: the session is not captured, or the disk lacks space.
        """
        state = self.refresh().state
        if state in (State.CREATED, State.CAPTURING, State.PAUSED):
            raise Refused(f"session {self.name} is {state.name.lower()}; it must be captured before it is exported")
        self.frames().write(directory)

    def replicate(self, node: str) -> int:
        """Copies the frames to another node, from which solvers can then also read; returns its size in bytes.

        ``node``: a camera, or a solver that stores archives. Repeating the call copies what is missing. NotFound: no such
        node. Refused: the session is being captured, or the node does not store archives.
        """
        request = pb.ReplicateSessionRequest(name=self.name, node=node)
        copied = pb.ReplicateSessionResponse()
        for copied in self._connection.stream(self._stub.ReplicateSession, request, _COPY_SECONDS):
            pass
        self.refresh()
        return copied.bytes_done

    def _matte_bytes(self, request: pb.FetchMatteRequest) -> bytes:
        answers = self._connection.stream(self._stub.FetchMatte, request, _FETCH_SECONDS)
        return b"".join(answer.chunk for answer in answers)

    def _matte_request(self, frame: int | None, crop: str | None) -> pb.FetchMatteRequest:
        return pb.FetchMatteRequest(name=self.name, frame=frame, region=None if crop is None else _region(crop))

    def _ask(self, rpc: Any, request: Any, seconds: float = LONG_CALL_SECONDS) -> SessionInfo:
        answer = self._connection.call(rpc, request, seconds)
        self.info = SessionInfo.from_message(answer.session)
        return self.info

    def _events(self, timeout: float | None) -> Iterator[SessionInfo]:
        ends = None if timeout is None else time.monotonic() + timeout
        last: SessionInfo | None = None
        while True:
            # The watch is renewed, so that a hanging server is noticed.
            left = LONG_CALL_SECONDS if ends is None else min(LONG_CALL_SECONDS, max(ends - time.monotonic(), 0.0))
            heard = False
            try:
                request = pb.WatchSessionRequest(name=self.name)
                for answer in self._connection.stream(self._stub.WatchSession, request, left):
                    heard = True
                    self.info = SessionInfo.from_message(answer.session)
                    if self.info != last:
                        last = self.info
                        yield self.info
                return  # the server ends the stream when the session rests
            except TimedOut:
                if ends is not None and time.monotonic() >= ends:
                    raise TimedOut(f"{self.info} after {timeout:g} s") from None
                if not heard:
                    raise
