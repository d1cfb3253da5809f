"""The rig as its server knows it: nodes, sessions, new captures, and who holds it."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import enum
import os
import pathlib
import time
import uuid
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any

import grpc

from glasswing import pictures
from glasswing.connection import CHUNK_BYTES, LONG_CALL_SECONDS, Connection, Hold
from glasswing.errors import Error, Refused, TimedOut, Unavailable
from glasswing.fleet import Fleet
from glasswing.plan import Plan
from glasswing.session import Session, SessionInfo, State
from glasswing.settings import load_settings
from glasswing.v1 import archive_pb2, fleet_service_pb2, node_service_pb2, plan_pb2, rig_service_pb2, session_pb2
from glasswing.v1 import session_service_pb2 as pb
from glasswing.v1.fleet_service_pb2_grpc import FleetServiceStub
from glasswing.v1.node_service_pb2_grpc import NodeServiceStub
from glasswing.v1.rig_service_pb2_grpc import RigServiceStub
from glasswing.v1.session_service_pb2_grpc import SessionServiceStub


class NodeKind(enum.Enum):
    """What a node does."""

    DISPLAY = node_service_pb2.NODE_KIND_DISPLAY
    CAMERA = node_service_pb2.NODE_KIND_CAMERA
    SOLVER = node_service_pb2.NODE_KIND_SOLVER


@dataclasses.dataclass(frozen=True)
class Node:
    """A program that belongs to the rig. ``up``: it was heard of in the last five seconds."""

    kind: NodeKind
    name: str
    address: str
    version: str
    up: bool
    detail: str
    """For people: "back 128x96 at 60 Hz", "solving s1 tile 3"."""


@dataclasses.dataclass(frozen=True)
class Holder:
    """Who drives the rig now. ``client``: "anna@lab3", or empty; ``what``: "session vase", or a hold's reason."""

    client: str
    what: str
    since: datetime.datetime | None


@dataclasses.dataclass(frozen=True)
class Monitor:
    """A monitor: what its patterns measure (an id patch of ``patch_rows`` lies below them)."""

    name: str
    width_px: int
    height_px: int
    refresh_hz: float
    patch_rows: int
    bits: int

    @classmethod
    def from_message(cls, message: archive_pb2.Monitor) -> Monitor:
        """What a message of the wire says."""
        return cls(
            message.name, message.width_px, message.height_px, message.refresh_hz, message.patch_rows, message.bits
        )


@dataclasses.dataclass(frozen=True)
class Estimate:
    """What a capture would cost, nothing retaken. The three about the video are counted in the others, too."""

    steps: int
    steps_without_object: int
    seconds: float
    """Of showing."""
    bytes: int
    """Of frames."""
    free_bytes: int
    """Where they would be kept."""
    monitors: tuple[Monitor, ...]
    camera_width_px: int
    camera_height_px: int
    video_frames: int
    video_seconds: float
    video_bytes: int
    holder: Holder | None
    """Who has the rig now; None: it is free."""
    warnings: tuple[str, ...]
    """For people: what would make the capture less sure than it could be."""


def connect(
    server: str | None = None,
    *,
    ca: str | os.PathLike[str] | None = None,
    certificate: str | os.PathLike[str] | None = None,
    key: str | os.PathLike[str] | None = None,
    timeout: float = 10.0,
) -> Rig:
    """Connects to a glasswing-server, and asks it something to see that it answers.

    ``server``: "host:port". ``ca``: PEM file of the authority that signed the server's certificate; with it the
    connection is encrypted. ``certificate``, ``key``: PEM files of this client's own, for a server that asks for them.
    What is left out comes from the environment and the file that the command line reads too (``glasswing.settings``);
    without any, 127.0.0.1:7440. ``timeout``: seconds that an ordinary call may take.

    InvalidInput: another machine than this one without ``ca``, or files that are no PEM. Unavailable: it does not answer.
    """
    rig = Rig(Connection(load_settings(server, ca, certificate, key), timeout))
    try:
        rig.nodes()
    except BaseException:
        rig.close()
        raise
    return rig


class Rig:
    """A server and the rig it drives; ``connect()`` makes one. Leaving its ``with`` block ends the connection only."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._fleet = connection.stub(FleetServiceStub)
        self._nodes = connection.stub(NodeServiceStub)
        self._rig = connection.stub(RigServiceStub)
        self._sessions = connection.stub(SessionServiceStub)

    def __enter__(self) -> Rig:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection. What the server does goes on."""
        self._connection.close()

    def nodes(self) -> list[Node]:
        """Every node that belongs to the rig, those that are away too."""
        return [
            Node(NodeKind(node.kind), node.name, node.address, node.version, node.up, node.detail)
            for node in self._list_nodes().nodes
        ]

    def fleet(self) -> Fleet:
        """Who solves, what, and how fast; and what is still to be solved."""
        answer: fleet_service_pb2.GetFleetResponse = self._connection.call(
            self._fleet.GetFleet, fleet_service_pb2.GetFleetRequest()
        )
        return Fleet.from_message(answer)

    def holder(self) -> Holder | None:
        """Who drives the rig now; None: it is free."""
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
        """The sessions that all of these hold for, newest first.

        ``text``: in name, note, a tag or the reason, whatever the case. ``tags``: has all of them. ``states``: is in one of
        them. ``since``, ``before``: when it was created; a time without a zone is local.
        """
        request = pb.ListSessionsRequest(
            text=text,
            tags=list(tags),
            states=[state.value for state in states],
            created_from=_rfc3339(since),
            created_before=_rfc3339(before),
        )
        answer: pb.ListSessionsResponse = self._connection.call(self._sessions.ListSessions, request)
        return [self._session(session) for session in answer.sessions]

    def session(self, name: str) -> Session:
        """The session of this name. NotFound: there is none."""
        answer: pb.GetSessionResponse = self._connection.call(
            self._sessions.GetSession, pb.GetSessionRequest(name=name)
        )
        return self._session(answer.session)

    def estimate(self, plan: Plan, name: str = "") -> Estimate:
        """A dry run: checks what ``capture`` would, shows nothing, and says what it costs. The same errors."""
        return self._estimate(plan.to_message(), name)

    def capture(self, plan: Plan, name: str = "") -> Session:
        """Starts a capture, and returns at once; the server chooses a ``name`` if none is given.

        The plan's photos are read and sent, scaled to the first monitor. InvalidInput: the plan or the name, naming the
        field; AlreadyExists: the name is taken; Refused: somebody has the rig, or it lacks what the plan needs;
        Unavailable: a node is away.
        """
        message = plan.to_message()
        self._upload_photos(message)
        request = pb.CreateSessionRequest(request_id=uuid.uuid4().hex, name=name, plan=message)
        create = self._sessions.CreateSession
        try:
            answer: pb.CreateSessionResponse = self._connection.call(create, request, LONG_CALL_SECONDS)
        except TimedOut:  # the request id makes asking again safe when only the answer was lost
            answer = self._connection.call(create, request, LONG_CALL_SECONDS)
        return self._session(answer.session)

    @contextlib.contextmanager
    def hold(self, reason: str) -> Iterator[None]:
        """Keeps the rig for this object, between sessions too, for as long as the block lasts.

        ``reason`` is told to whoever else wants the rig ("turntable series"), 1 to 200 bytes. Refused names who has it.
        If the server is lost meanwhile, so is the hold: every call then raises ``Unavailable``. A program that was started
        under a hold (GLASSWING_HOLD is its token) goes on under that one.
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

    def upload(self, picture: pictures.Picture) -> str:
        """Stores a picture (linear, H x W x 3) for plans, and returns the name by which a ``Photo.file`` may call it."""
        png = pictures.encode_png16(picture)
        chunks = (pb.UploadImageRequest(chunk=png[at : at + CHUNK_BYTES]) for at in range(0, len(png), CHUNK_BYTES))
        answer: pb.UploadImageResponse = self._connection.call(
            self._sessions.UploadImage, chunks, LONG_CALL_SECONDS
        )
        return answer.image

    def _session(self, message: session_pb2.Session) -> Session:
        return Session(self._connection, SessionInfo.from_message(message))

    def _wait_until_freed(self, reason: str) -> None:
        """The server learns of the call's end a little later; what comes next shall find the rig free."""
        ends = time.monotonic() + self._connection.timeout
        with contextlib.suppress(Error):  # a server that is gone holds nothing
            while time.monotonic() < ends and (holder := self.holder()) is not None and holder.what == reason:
                time.sleep(0.02)

    def _list_nodes(self) -> node_service_pb2.ListNodesResponse:
        request = node_service_pb2.ListNodesRequest()
        answer: node_service_pb2.ListNodesResponse = self._connection.call(self._nodes.ListNodes, request)
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
        """Puts the uploaded pictures into the plan in place of the files' names."""
        if not plan.photos:
            return
        monitors = self._estimate(plan, "").monitors
        shown_on = plan.monitors[0].name if plan.monitors else monitors[0].name
        monitor = next(monitor for monitor in monitors if monitor.name == shown_on)
        for photo in plan.photos:
            picture = pictures.read_picture(photo.file)
            photo.name = photo.name or pathlib.Path(photo.file).stem
            photo.file = self.upload(pictures.resized(picture, monitor.width_px, monitor.height_px))


def _holder(message: Any) -> Holder | None:
    if not message.HasField("holder"):
        return None
    holder = message.holder
    since = datetime.datetime.fromisoformat(holder.since) if holder.since else None
    return Holder(holder.client, holder.what, since)


def _rfc3339(moment: datetime.datetime | None) -> str:
    if moment is None:
        return ""
    return moment.astimezone(datetime.timezone.utc).isoformat(timespec="microseconds").replace("+00:00", "Z")
