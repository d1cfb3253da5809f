"""The rig as its server knows it: nodes, sessions, new captures, and its holder."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import enum
import math
import os
import pathlib
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import TracebackType
from typing import Any

import grpc
import numpy.typing as npt

from glasswing import live, notebook, pictures
from glasswing.capture_queue import CaptureQueue
from glasswing.connection import CHUNK_BYTES, LONG_CALL_SECONDS, Connection, Hold
from glasswing.errors import Error, NotFound, Refused, TimedOut, Unavailable
from glasswing.fleet import Fleet
from glasswing.instruments import Calibration, Finding, LivePicture, MonitorLatency
from glasswing.live import LiveComposite
from glasswing.plan import Plan
from glasswing.session import Session, SessionInfo, State
from glasswing.settings import load_settings
from glasswing.stage import Stage, pose_names
from glasswing.v1 import archive_pb2, camera_service_pb2, fleet_service_pb2, node_service_pb2, plan_pb2, rig_service_pb2, session_pb2
from glasswing.v1 import session_service_pb2 as pb
from glasswing.v1.camera_service_pb2_grpc import CameraServiceStub
from glasswing.v1.fleet_service_pb2_grpc import FleetServiceStub
from glasswing.v1.node_service_pb2_grpc import NodeServiceStub
from glasswing.v1.rig_service_pb2_grpc import RigServiceStub
from glasswing.v1.session_service_pb2_grpc import SessionServiceStub


_MEASURE_SECONDS = 300.0
_FIT_SECONDS = 600.0
_SHOW_SECONDS = 86400.0


class NodeKind(enum.Enum):
    """The kind of a node."""

    DISPLAY = node_service_pb2.NODE_KIND_DISPLAY
    CAMERA = node_service_pb2.NODE_KIND_CAMERA
    SOLVER = node_service_pb2.NODE_KIND_SOLVER


@dataclasses.dataclass(frozen=True)
class Preparation:
    """What a node is doing before it can be used, such as a camera that simulates its scene."""

    what: str
    done: float | None
    """Fraction done, 0 to 1; None: unknown."""

    @classmethod
    def from_message(cls, message: node_service_pb2.Preparation) -> Preparation:
        """Converts a wire message."""
        return cls(message.what, message.done if message.HasField("done") else None)

    def __str__(self) -> str:
        return self.what if self.done is None else f"{self.what}, {math.floor(100.0 * self.done)} %"


@dataclasses.dataclass(frozen=True)
class Node:
    """A program of the rig. ``up``: it was seen in the last five seconds."""

    kind: NodeKind
    name: str
    address: str
    version: str
    up: bool
    detail: str
    """Readable text: "back 128x96 at 60 Hz", "solving s1 tile 3"."""
    preparation: Preparation | None = None
    """None: it can be used."""

    @classmethod
    def from_message(cls, message: node_service_pb2.Node) -> Node:
        """Converts a wire message."""
        return cls(
            NodeKind(message.kind),
            message.name,
            message.address,
            message.version,
            message.up,
            message.detail,
            Preparation.from_message(message.preparation) if message.HasField("preparation") else None,
        )


@dataclasses.dataclass(frozen=True)
class Holder:
    """The rig's current holder. ``client``: "anna@lab3", or empty; ``what``: "session vase", or a hold's reason with what
    drives the rig: "series (session vase)"."""

    client: str
    what: str
    since: datetime.datetime | None


@dataclasses.dataclass(frozen=True)
class Monitor:
    """A monitor: the size of its patterns, without the id patch of ``patch_rows`` rows below them."""

    name: str
    width_px: int
    height_px: int
    refresh_hz: float
    patch_rows: int
    bits: int

    @classmethod
    def from_message(cls, message: archive_pb2.Monitor) -> Monitor:
        """Converts a wire message."""
        return cls(
            message.name, message.width_px, message.height_px, message.refresh_hz, message.patch_rows, message.bits
        )


@dataclasses.dataclass(frozen=True)
class Estimate:
    """What a capture would cost without retakes. The totals include the video."""

    steps: int
    steps_without_object: int
    seconds: float
    """Duration of the capture."""
    bytes: int
    """Size of the frames."""
    free_bytes: int
    """Free space at the node that would store them."""
    monitors: tuple[Monitor, ...]
    camera_width_px: int
    camera_height_px: int
    video_frames: int
    video_seconds: float
    video_bytes: int
    holder: Holder | None
    """The rig's current holder; None: it is free."""
    warnings: tuple[str, ...]
    """For display: what would make the capture less reliable."""


def connect(
    server: str | None = None,
    *,
    ca: str | os.PathLike[str] | None = None,
    certificate: str | os.PathLike[str] | None = None,
    key: str | os.PathLike[str] | None = None,
    timeout: float = 10.0,
) -> Rig:
    """Connects to a glasswing-server and checks that it answers.

    ``server``: "host:port". ``ca``: PEM file of the authority that signed the server's certificate; with it the
    connection is encrypted. ``certificate``, ``key``: PEM files of this client, for a server that authenticates callers.
    Arguments that are left out come from the environment and the configuration file, as for the command line
    (``glasswing.settings``); the default server is 127.0.0.1:7440. ``timeout``: limit of an ordinary call, in seconds.

    InvalidInput: another machine without ``ca``, or files that are not PEM. Unavailable: the server does not answer.
    """
    rig = Rig(Connection(load_settings(server, ca, certificate, key), timeout))
    try:
        rig.nodes()
    except BaseException:
        rig.close()
        raise
    return rig


class Rig:
    """A server and its rig; ``connect()`` makes one. Leaving the ``with`` block only closes the connection."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._fleet = connection.stub(FleetServiceStub)
        self._nodes = connection.stub(NodeServiceStub)
        self._rig = connection.stub(RigServiceStub)
        self._sessions = connection.stub(SessionServiceStub)
        self.queue = CaptureQueue(connection, self.upload, self._upload_photos)
        """Captures that the server runs one after the other."""

    def __repr__(self) -> str:
        return f"<rig of the {self._connection.title}>"

    def _repr_html_(self) -> str:
        try:
            nodes, holder = self.nodes(), self.holder()
        except Error as error:
            return notebook.text(error)
        rows = [(node.kind.name.lower(), node.name, _condition(node), node.detail) for node in nodes]
        held = f"held by {holder.client or 'somebody'} for {holder.what}" if holder else "free"
        return notebook.text(f"{self!r}: {held}") + notebook.table(rows, ("kind", "name", "state", "detail"))

    def __enter__(self) -> Rig:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connection. Captures and solves continue."""
        self._connection.close()

    def nodes(self) -> list[Node]:
        """All nodes of the rig, including unreachable ones."""
        return [Node.from_message(node) for node in self._list_nodes().nodes]

    def fleet(self) -> Fleet:
        """The solvers with their work and speed, and the unfinished solves."""
        answer: fleet_service_pb2.GetFleetResponse = self._connection.call_pages(
            self._fleet.GetFleet, fleet_service_pb2.GetFleetRequest()
        )
        return Fleet.from_message(answer)

    def holder(self) -> Holder | None:
        """The rig's current holder; None: it is free."""
        return _holder(self._list_nodes())

    def sessions(
        self,
        *,
        text: str = "",
        tags: Iterable[str] = (),
        states: Iterable[State] = (),
        since: datetime.datetime | None = None,
        before: datetime.datetime | None = None,
    ) -> list[Session]:
        """The sessions that match all conditions, newest first.

        ``text``: occurs in the name, the note, a tag or the reason, ignoring case. ``tags``: all of them. ``states``: one of
        them. ``since``, ``before``: limits of the creation time; a time without a zone is local.
        """
        request = pb.ListSessionsRequest(
            text=text,
            tags=list(tags),
            states=[state.value for state in states],
            created_from=_rfc3339(since),
            created_before=_rfc3339(before),
        )
        answer: pb.ListSessionsResponse = self._connection.call_pages(self._sessions.ListSessions, request)
        return [self._session(session) for session in answer.sessions]

    def session(self, name: str) -> Session:
        """The session of this name. NotFound: there is no such session."""
        answer: pb.GetSessionResponse = self._connection.call(
            self._sessions.GetSession, pb.GetSessionRequest(name=name)
        )
        return self._session(answer.session)

    def estimate(self, plan: Plan, name: str = "") -> Estimate:
        """A dry run: makes the same checks as ``capture``, with the same errors, and returns the cost."""
        return self._estimate(plan.to_message(), name)

    def stage(self, camera: str = "") -> Stage:
        """The axes of a camera's stage. ``camera``: a camera node's name; default: the only one that is up. Unavailable: no such
        camera is up."""
        return Stage(self._connection, self._camera_address(camera), camera)

    def capture(
        self,
        plan: Plan,
        name: str = "",
        *,
        solve: bool = False,
        axes: Mapping[str, float] | None = None,
        empty_stage_of: str = "",
    ) -> Session:
        """Starts a capture and returns at once; the server chooses a ``name`` if none is given.

        With ``solve`` it is solved with the plan's method as soon as it is captured. ``axes``: where the stage's axes shall put
        the object, by name, degrees or mm. ``empty_stage_of``: a captured session of the same plan, whose frames of the empty
        stage are taken.

        The plan's photos are scaled to the first monitor and uploaded. InvalidInput: the plan or the name is wrong; the
        message names the field. AlreadyExists: the name is taken. Refused: another client holds the rig, or it lacks
        something that the plan needs. Unavailable: a node is unreachable.
        """
        return self._create(plan.to_message(), name, solve, axes or {}, empty_stage_of)

    def capture_turn(
        self, plan: Plan, series: str, positions: Iterable[float], *, axis: str = "turn", solve: bool = False
    ) -> Iterator[Session]:
        """Captures a plan in many poses of the object, which the stage turns, and yields each session when it is captured, and
        with ``solve`` solved.

        The sessions are "vase-000", "vase-010", ..., with the series' name as a tag, like those of ``glasswing capture --turn``.
        The first has the empty stage, which the others take from it. Sessions that are captured already are yielded as they are,
        so that the same call takes a series up again. NotFound: the stage has no such axis. Stopped: a session was paused, failed
        or was cancelled.
        """
        values = [float(position) for position in positions]
        names = pose_names(series, values)
        units = {each.name: each.unit for each in self.stage(plan.camera).axes()}
        if axis not in units:
            raise NotFound(f'the stage has no axis "{axis}"; it has: {", ".join(units) or "none"}')
        for number, (name, position) in enumerate(zip(names, values), start=1):
            try:
                session = self.session(name)
                if session.info.state in (State.PAUSED, State.FAILED):
                    session.resume()
            except NotFound:
                shared = "" if number == 1 or plan.skip_empty_stage else names[0]
                session = self.capture(plan, name, solve=solve, axes={axis: position}, empty_stage_of=shared)
                session.annotate(note=f"{axis} at {position:g} {units[axis]}, pose {number} of {len(names)}", add_tags=[series])
            if dict(session.info.axes) != {axis: position}:
                raise Refused(f'there is a session "{name}" already, which is not at {position:g} of axis "{axis}"')
            session.wait()
            yield session

    def _create(
        self,
        message: plan_pb2.Plan,
        name: str,
        solve: bool,
        axes: Mapping[str, float] = {},
        empty_stage_of: str = "",
    ) -> Session:
        self._upload_photos(message)
        request = pb.CreateSessionRequest(
            request_id=uuid.uuid4().hex, name=name, plan=message, solve=solve, axes=dict(axes), empty_stage_of=empty_stage_of
        )
        create = self._sessions.CreateSession
        try:
            answer: pb.CreateSessionResponse = self._connection.call(create, request, LONG_CALL_SECONDS)
        except TimedOut:  # the request id makes a retry safe if only the answer was lost
            answer = self._connection.call(create, request, LONG_CALL_SECONDS)
        return self._session(answer.session)

    @contextlib.contextmanager
    def hold(self, reason: str) -> Iterator[None]:
        """Holds the rig for this object while the block runs, also between sessions.

        ``reason``, 1 to 200 bytes, is shown to other clients ("turntable series"). Refused names the rig's holder. If the
        server is lost, so is the hold: every later call raises ``Unavailable``. A program started under a hold
        (GLASSWING_HOLD is its token) uses that hold.
        """
        held = self._connection.hold
        if held is not None and held.call is not None:
            raise Refused(f'this program holds the rig already, for "{held.reason}"')
        if held is not None:
            yield
            return
        call = self._rig.HoldRig(rig_service_pb2.HoldRigRequest(reason=reason), metadata=self._connection.metadata())
        try:
            try:
                token = next(call).token
            except grpc.RpcError as error:
                raise self._connection.error_of(error) from None
            except StopIteration:
                raise Unavailable(f"{self._connection.title} ended the hold") from None
            self._connection.hold = Hold(token, reason, call)
            yield
        finally:
            self._connection.hold = None
            call.cancel()
            self._wait_until_freed(reason)

    def doctor(self, plan: Plan | None = None) -> Iterator[Finding]:
        """Tests the rig, for this plan's monitors and exposures if one is given, and yields each finding as it is made.

        Shows and records some steps. InvalidInput: the plan. Refused names the rig's holder.
        """
        request = rig_service_pb2.CheckRigRequest(plan=plan.to_message() if plan else None)
        for answer in self._connection.stream(self._rig.CheckRig, request, _MEASURE_SECONDS):
            yield Finding.from_message(answer.finding)

    def calibrate_sync(
        self, monitors: Iterable[str] = (), *, exposure_ms: float = 0.0, camera: str = ""
    ) -> list[MonitorLatency]:
        """Measures the latency of these monitors' light (default: all), and stores it for all later proofs.

        ``exposure_ms``: 0 is four fifths of the frame interval. Refused: the message says why a monitor could not be
        measured; the others are stored.
        """
        return list(self._latencies(monitors, exposure_ms, camera))

    def _latencies(self, monitors: Iterable[str], exposure_ms: float, camera: str) -> Iterator[MonitorLatency]:
        request = rig_service_pb2.CalibrateSyncRequest(
            monitors=list(monitors), exposure_ms=exposure_ms, camera=camera
        )
        for answer in self._connection.stream(self._rig.CalibrateSync, request, _MEASURE_SECONDS):
            if answer.HasField("result"):
                yield MonitorLatency.from_message(answer.result)

    def calibrate(
        self, monitors: Iterable[str] = (), *, camera: str = "", longest_exposure_ms: float = 0.0
    ) -> Calibration:
        """Measures timing, camera and monitors (default: all), and stores it for all later sessions, like "glasswing
        calibrate all". Takes minutes.

        Nothing must be on the stage, the room must be dark, and the monitors warm. ``longest_exposure_ms``: the longest of
        later captures; at least 16 ms are measured. ``notes`` name monitors that cannot be measured, such as one that the
        camera does not see.
        Stopped: a measuring session failed; ``info`` is its state. Refused: nothing could be measured, or another client
        holds the rig.
        """
        names = list(monitors)
        self._some_latencies(names, camera)
        of_camera = rig_service_pb2.MakePlanRequest(
            purpose=rig_service_pb2.PLAN_PURPOSE_CALIBRATE_CAMERA,
            monitors=names,
            camera=camera,
            longest_exposure_ms=longest_exposure_ms,
        )
        of_displays = rig_service_pb2.MakePlanRequest(
            purpose=rig_service_pb2.PLAN_PURPOSE_CALIBRATE_DISPLAYS, monitors=names, camera=camera
        )
        camera_fit, camera_notes = self._measured(of_camera)
        display_fit, display_notes = self._measured(of_displays)
        # With the camera's codes linearised: a curved response shifts the measured time of a change.
        latencies, sync_notes = self._some_latencies(names, camera)
        return Calibration(
            latencies=latencies,
            camera=camera_fit.camera if camera_fit.HasField("camera") else None,
            displays=tuple(display_fit.displays),
            notes=(*camera_notes, *display_notes, *sync_notes),
        )

    def _some_latencies(self, monitors: Iterable[str], camera: str) -> tuple[tuple[MonitorLatency, ...], list[str]]:
        """The monitors that can be measured, and why others cannot."""
        found: list[MonitorLatency] = []
        try:
            found.extend(self._latencies(monitors, 0.0, camera))
        except Refused as refused:
            if not found:
                raise
            return tuple(found), [f"not measured: {refused}"]
        return tuple(found), []

    def _measured(
        self, request: rig_service_pb2.MakePlanRequest
    ) -> tuple[rig_service_pb2.FitCalibrationResponse, list[str]]:
        """Captures the server's plan and fits it; also returns notes for display."""
        made: rig_service_pb2.MakePlanResponse = self._connection.call(self._rig.MakePlan, request, LONG_CALL_SECONDS)
        notes = list(made.notes)
        if not made.HasField("plan"):
            return rig_service_pb2.FitCalibrationResponse(), notes
        now = datetime.datetime.now(datetime.timezone.utc)
        session = self._create(made.plan, f"calibrate-{made.plan.calibration.of}-{now:%Y%m%dT%H%M%S.%fZ}", solve=False)
        session.wait()
        fit = self.calibrate_light(session)
        for device in (fit.camera, *fit.displays):
            notes += device.warnings
        return fit, [*notes, *(f"not measured: {why}" for why in fit.unmeasured)]

    def calibrate_light(self, session: Session) -> rig_service_pb2.FitCalibrationResponse:
        """Fits and stores the response that a captured session measured: a plan with ``CalibrationFrames``.

        Later sessions use it. Refused: the message says what is missing in the frames.
        """
        request = rig_service_pb2.FitCalibrationRequest(session=session.name)
        answer: rig_service_pb2.FitCalibrationResponse = self._connection.call(
            self._rig.FitCalibration, request, _FIT_SECONDS
        )
        return answer

    @contextlib.contextmanager
    def pattern(self, name: str, monitors: Iterable[str] = ()) -> Iterator[list[str]]:
        """Shows a test pattern while the block runs, and yields the monitors that show it (default: all). Holds the rig.

        ``name``: "lines" (to focus on), "bars", "white", "gray", "ramp" or "black".
        """
        request = rig_service_pb2.ShowPatternRequest(pattern=name, monitors=list(monitors))
        answers = self._connection.stream(self._rig.ShowPattern, request, _SHOW_SECONDS)
        try:
            yield list(next(answers).monitors)
        finally:
            answers.close()
            self._wait_until_freed(f"pattern {name}")

    def preview(
        self, *, camera: str = "", max_fps: float = 2.0, max_width_px: int = 640, exposure_ms: float = 0.0
    ) -> Iterator[LivePicture]:
        """Yields the camera's view until the loop is left; a capture may run meanwhile. Waits while the camera is preparing
        (``Node.preparation``).

        ``camera``: a camera node's name; default: the first that is up. ``max_fps``: 0.2 to 10. ``exposure_ms``: 0 is about
        4; ignored while a capture runs. Unavailable: no such camera is up.
        """
        request = camera_service_pb2.PreviewRequest(
            max_fps=max_fps, max_width_px=max_width_px, exposure_ms=exposure_ms
        )
        connection = self._connection.to(self._camera_address(camera), "camera node")
        try:
            stub = connection.stub(CameraServiceStub)
            for picture in connection.stream(stub.Preview, request, _SHOW_SECONDS):
                if not picture.HasField("preparation"):
                    yield LivePicture.from_message(picture)
        finally:
            connection.close()

    def live(
        self,
        background: npt.ArrayLike,
        *,
        monitor: str = "",
        camera: str = "",
        exposure_ms: float = 4.0,
        options: Mapping[str, str] | None = None,
        ask: Callable[[str], object] = lambda what: input(f"{what}, then press Enter "),
    ) -> Iterator[LiveComposite]:
        """Yields the object in front of ``background`` (linear, H x W x 3) as the camera sees it, until the loop is left.

        The server shows the ramp on ``monitor`` and a listening solver learns the empty stage; then the object is placed.
        Holds
        the rig. ``exposure_ms``: for each frame. ``options``: of method ``ramp``. ``ask`` is called with instructions when
        the object must be moved, and returns when that is done. InvalidInput: an option, or no such monitor. Refused: no
        solver offers live composites, or another client holds the rig, whom the message names.
        """
        try:
            yield from live.composites(
                self._connection,
                background,
                monitor=monitor,
                camera=camera,
                exposure_ms=exposure_ms,
                options=options or {},
                ask=ask,
            )
        finally:
            self._wait_until_freed("live")

    def make_plan(
        self,
        quality: str = "good",
        *,
        images: int | None = None,
        monitors: Iterable[str] = (),
        camera: str = "",
        blur_px: float = 0.0,
        object: str = "clear",
    ) -> Plan:
        """Makes a plan for method ``gaussian`` that fits the rig's monitors and camera, like ``glasswing plan make
        --for-rig``.

        ``quality``: "draft" (about a hundred images), "good", or "best" (finer stripes, and a second exposure for highlights).
        ``images``: the maximum number with the object at each exposure, 1 to 20000. ``monitors``: default all. ``blur_px``:
        the blur of camera and monitor (sigma on the monitor, 0 to 200), as measured by ``glasswing blur``. ``object``:
        "clear",
        "frosted" (wider stripes), "metal" (a second exposure for highlights), or "dark" (a second, longer exposure).
        InvalidInput: ``images`` are too few.
        """
        request = rig_service_pb2.MakePlanRequest(
            purpose=rig_service_pb2.PLAN_PURPOSE_CAPTURE,
            monitors=list(monitors),
            camera=camera,
            quality=quality,
            image_count=images or 0,
            blur_px=blur_px,
            object=object,
        )
        answer: rig_service_pb2.MakePlanResponse = self._connection.call(self._rig.MakePlan, request, LONG_CALL_SECONDS)
        return Plan.from_message(answer.plan)

    def upload(self, picture: pictures.Picture) -> str:
        """Uploads a picture (linear, H x W x 3) for plans and returns its name, for ``Photo.file``."""
        png = pictures.encode_png16(picture)
        chunks = (pb.UploadImageRequest(chunk=png[at : at + CHUNK_BYTES]) for at in range(0, len(png), CHUNK_BYTES))
        answer: pb.UploadImageResponse = self._connection.call(
            self._sessions.UploadImage, chunks, LONG_CALL_SECONDS
        )
        return answer.image

    def _session(self, message: session_pb2.Session) -> Session:
        return Session(self._connection, SessionInfo.from_message(message))

    def _camera_address(self, camera: str) -> str:
        cameras = [node for node in self.nodes() if node.kind is NodeKind.CAMERA and node.up and camera in ("", node.name)]
        if not cameras:
            raise Unavailable(f'camera node "{camera}" is not up' if camera else "no camera node is up; start glasswing-camera")
        if len(cameras) > 1:
            names = ", ".join(node.name for node in cameras)
            raise Refused(f"the rig has several cameras, {names}; name one with camera=")
        return cameras[0].address

    def _wait_until_freed(self, what: str) -> None:
        """Waits until the server has noticed the end of a hold, or of the rig's current use ("series (pattern lines)" in a
        hold), so that the next call finds the rig free."""
        ends = time.monotonic() + self._connection.timeout
        with contextlib.suppress(Error):  # a server that is gone holds nothing
            while time.monotonic() < ends and (holder := self.holder()) is not None:
                if not (holder.what == what or holder.what.startswith(f"{what} (") or holder.what.endswith(f" ({what})")):
                    return
                time.sleep(0.02)

    def _list_nodes(self) -> node_service_pb2.ListNodesResponse:
        request = node_service_pb2.ListNodesRequest()
        answer: node_service_pb2.ListNodesResponse = self._connection.call_pages(self._nodes.ListNodes, request)
        return answer

    def _estimate(self, plan: plan_pb2.Plan, name: str) -> Estimate:
        request = pb.EstimateSessionRequest(name=name, plan=plan)
        answer: pb.EstimateSessionResponse = self._connection.call(
            self._sessions.EstimateSession, request, LONG_CALL_SECONDS
        )
        return Estimate(
            steps=answer.step_count,
            steps_without_object=answer.steps_without_object,
            seconds=answer.seconds,
            bytes=answer.bytes,
            free_bytes=answer.free_bytes,
            monitors=tuple(Monitor.from_message(monitor) for monitor in answer.monitors),
            camera_width_px=answer.camera.width_px,
            camera_height_px=answer.camera.height_px,
            video_frames=answer.video_frames,
            video_seconds=answer.video_seconds,
            video_bytes=answer.video_bytes,
            holder=_holder(answer),
            warnings=tuple(answer.warnings),
        )

    def _upload_photos(self, plan: plan_pb2.Plan) -> None:
        """Uploads the plan's photos and replaces their file names with the names of the uploads."""
        if not plan.photos:
            return
        monitors = self._estimate(plan, "").monitors
        shown_on = plan.monitors[0].name if plan.monitors else monitors[0].name
        monitor = next(monitor for monitor in monitors if monitor.name == shown_on)
        for photo in plan.photos:
            picture = pictures.read_picture(photo.file)
            photo.name = photo.name or pathlib.Path(photo.file).stem
            photo.file = self.upload(pictures.resized(picture, monitor.width_px, monitor.height_px))


def _condition(node: Node) -> str:
    if not node.up:
        return "away"
    return str(node.preparation) if node.preparation else "up"


def _holder(message: Any) -> Holder | None:
    if not message.HasField("holder"):
        return None
    holder = message.holder
    since = datetime.datetime.fromisoformat(holder.since) if holder.since else None
    return Holder(holder.client, holder.what, since)


def _rfc3339(time_: datetime.datetime | None) -> str:
    if time_ is None:
        return ""
    return time_.astimezone(datetime.timezone.utc).isoformat(timespec="microseconds").replace("+00:00", "Z")
