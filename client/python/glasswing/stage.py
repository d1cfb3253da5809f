"""The stage's axes, and the object's poses on an axis whose place is known."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from glasswing.connection import Connection
from glasswing.errors import InvalidInput, Refused
from glasswing.v1 import axis_service_pb2, rays_pb2, rig_service_pb2
from glasswing.v1.axis_service_pb2_grpc import AxisServiceStub
from glasswing.v1.rig_service_pb2_grpc import RigServiceStub

_MOVE_SECONDS = 600.0


@dataclasses.dataclass(frozen=True)
class Axis:
    """An axis of the stage; positions are in ``unit``, "deg" or "mm"."""

    name: str
    unit: str
    min: float
    max: float
    position: float | None
    """None: unknown."""
    homes: bool
    """It can be homed."""

    @classmethod
    def from_message(cls, message: axis_service_pb2.Axis) -> Axis:
        """Converts a wire message."""
        position = message.position if message.HasField("position") else None
        return cls(message.name, message.unit, message.min, message.max, position, message.homes)


class Stage:
    """The axes of a camera node's stage, such as a turntable; ``Rig.stage()`` makes one.

    Errors: InvalidInput: no such axis, or a position outside its range. Refused: another client holds the rig, the device
    reported an error, or it was stopped; an axis that moved may stand anywhere then.
    """

    def __init__(self, connection: Connection, address: str, camera: str) -> None:
        self._connection = connection
        self._address = address  # of the camera node
        self._rig = connection.stub(RigServiceStub)
        self._camera = camera

    def axes(self) -> list[Axis]:
        """The axes, and where they stand; none: the stage has no motors."""
        node = self._connection.to(self._address, "camera node")
        try:
            answer: axis_service_pb2.GetAxesResponse = node.call(
                node.stub(AxisServiceStub).GetAxes, axis_service_pb2.GetAxesRequest()
            )
        finally:
            node.close()
        return [Axis.from_message(axis) for axis in answer.axes]

    def move(self, positions: Mapping[str, float]) -> list[Axis]:
        """Moves axes, by name, one after the other, and returns all when they have settled. Takes the rig, like a capture."""
        return self._place(rig_service_pb2.PlaceObjectRequest(camera=self._camera, positions=dict(positions)))

    def home(self, axes: Iterable[str] = ()) -> list[Axis]:
        """Moves axes (default: all) to 0 by their switches, and returns all."""
        names = list(axes) or [axis.name for axis in self.axes()]
        return self._place(rig_service_pb2.PlaceObjectRequest(camera=self._camera, home=names))

    def stop(self) -> None:
        """Stops all axes at once, whoever moves them."""
        self._connection.call(self._rig.StopObject, rig_service_pb2.StopObjectRequest(camera=self._camera))

    def _place(self, request: rig_service_pb2.PlaceObjectRequest) -> list[Axis]:
        answer: rig_service_pb2.PlaceObjectResponse = self._connection.call(self._rig.PlaceObject, request, _MOVE_SECONDS)
        return [Axis.from_message(axis) for axis in answer.axes]


def pose_names(series: str, positions: Iterable[float]) -> list[str]:
    """The sessions of a series, as ``glasswing capture --turn`` names them: "vase-000", "vase-010"."""
    values = list(positions)
    decimals = next(
        (n for n in range(4) if all(abs(p * 10**n - round(p * 10**n)) < 10**n * 5e-5 for p in values)), 4
    )
    width = max((len(f"{value:.{decimals}f}") for value in values), default=0)
    return [f"{series}-{value:0{width}.{decimals}f}" for value in values]


def object_to_rig(geometry: rays_pb2.RigGeometry, axes: Mapping[str, float]) -> npt.NDArray[np.float64]:
    """The object's pose with a stage's axis at a position, ``{"turn": 30.0}`` (``SessionInfo.axes``), as a 4 x 4 matrix.

    It maps the object's frame, whose origin is on the axis and which turns with the table, to the rig's, which is the camera's:
    x right, y down, z forward, mm. ``geometry``: what ``read_geometry()`` returns, with the axis (``glasswing calibrate axis``).
    InvalidInput: no axis, or several. Refused: the geometry lacks the axis.
    """
    if len(axes) != 1:
        raise InvalidInput(f"a pose is known with one axis; there are {len(axes)}")
    ((name, position),) = axes.items()
    found = [axis for axis in geometry.axes if axis.name == name]
    if not found:
        raise Refused(f'the geometry has no axis "{name}"; glasswing calibrate axis measures it')
    x, y, z = found[0].direction
    angle = math.radians(position)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    pose = np.eye(4)
    pose[:3, :3] += math.sin(angle) * across + (1.0 - math.cos(angle)) * across @ across
    pose[:3, 3] = found[0].point_mm
    return pose
