"""Capture plans: what the monitors show and how it is exposed.

The fields are those of proto/glasswing/v1/plan.proto. A field that is left out (``None``) has the default given there.
The server checks a plan when it is estimated or captured; its error names the field, its value and what would be
accepted.
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
import typing
from collections.abc import Sequence

from google.protobuf import text_format

from glasswing.errors import InvalidInput, NotFound
from glasswing.v1 import plan_pb2

Colour = tuple[float, float, float]
"""Linear red, green and blue, each in [0, 1]."""

BLACK: Colour = (0.0, 0.0, 0.0)
WHITE: Colour = (1.0, 1.0, 1.0)


class _Value:
    """Stores lists as tuples, so that a plan equals the one that the server returns."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, list):
                object.__setattr__(self, name, tuple(value))


@dataclasses.dataclass(frozen=True)
class PlanMonitor:
    """A monitor of the rig to use. If sizes (px) are given, the rig's monitor must have them."""

    name: str
    width_px: int | None = None
    height_px: int | None = None


@dataclasses.dataclass(frozen=True)
class Sweep:
    """A Gaussian stripe that moves across the whole monitor; captured only with the object.

    ``orientation_deg``: direction of travel from +x (right) towards +y (down), -180 to 180. ``sigma_px``: half width, in
    (0, 200]. ``step_px``: distance between pictures, in (0, 1.5 sigma_px], default sigma_px / 2. ``margin_sigmas``:
    travel past the monitor's edge, 0 to 10, default 2. ``peak``: radiance, in (0, 1], default 1.
    """

    orientation_deg: float
    sigma_px: float
    step_px: float | None = None
    margin_sigmas: float | None = None
    peak: float | None = None


@dataclasses.dataclass(frozen=True)
class Solid(_Value):
    """One colour on the whole monitor; captured with and without the object."""

    colour: Colour


@dataclasses.dataclass(frozen=True)
class SquareWaves:
    """Vertical and horizontal bars of halving widths, each with its complement; 1 to 14 ``levels``, 1 being the widest."""

    levels: int
    first_level: int | None = None
    without_complements: bool = False


@dataclasses.dataclass(frozen=True)
class Fringes(_Value):
    """Sinusoids along one direction: each period, 2 to 100000 px, at 2 to 32 ``phases`` (default 4).

    With 2 phases, a quarter of a period apart, only method "gaussian" solves them. ``object_only``: shown only with the
    object; solids and square waves then separate it from the stage.
    """

    orientation_deg: float
    period_px: Sequence[float]
    phases: int | None = None
    object_only: bool = False


@dataclasses.dataclass(frozen=True)
class Adapt:
    """Further rounds of images are chosen until 95 % of the object's pixels are known well enough.

    ``target_db``: the error of a composite due to noise, in decibels below full scale, 10 to 80, default 40.
    ``target_px``: alternatively, the standard error of a position on the monitor, 0.001 to 100. ``at_most``: images,
    including those without the object, 30 to 20000, default 200. ``footprints``: "gaussian", the default, or "any": as
    method gaussian's option; pixels that no few Gaussians explain then ask for waves in more directions.
    """

    target_db: float | None = None
    target_px: float | None = None
    at_most: int | None = None
    footprints: str = ""


@dataclasses.dataclass(frozen=True)
class Round(_Value):
    """Patterns chosen for what was uncertain at the time; ``why`` is for display. Shown only with the object."""

    fringes: Sequence[Fringes] = ()
    why: str = ""


@dataclasses.dataclass(frozen=True)
class Ramp:
    """The colour ramp of method "ramp": ``frames`` (1 to 18000) with the object, after ``empty_frames`` (1 to 1000)."""

    empty_frames: int | None = None
    frames: int | None = None


@dataclasses.dataclass(frozen=True)
class Photo:
    """A picture shown behind the object, for comparison only; sRGB unless ``file`` is OpenEXR.

    ``name``: name of its frame in the archive; default: the file's stem.
    """

    file: str
    name: str | None = None


@dataclasses.dataclass(frozen=True)
class CalibrationFrames:
    """Frames for calibrating devices (method "calibration"): ``of`` is "camera" or "display"."""

    of: str
    takes: int | None = None
    grays: int | None = None


@dataclasses.dataclass(frozen=True, kw_only=True)
class Plan(_Value):
    """What a session captures. Change one with ``dataclasses.replace(plan, exposure_ms=[2.0])``.

    ``method``: "gaussian", "hierarchical", "fringe", "alpha" or "ramp". ``monitors``: each is used in turn while the others
    are black; none: every monitor of the rig. ``hold_refreshes``: refreshes that a step stays on screen, 2 to 600,
    default 2. ``exposure_ms``: 0.01 to 10000, default 4; every step is captured once with each. ``retries``: how often a
    step without proof is shown again, 0 to 100, default 10. ``skip_empty_stage``: leaves out the frames without the
    object; then no silhouette is found, and every pixel is solved. ``white_every``: repeats white and black after this
    many steps, 2 to 10000, default never. ``camera``: the camera node that records; needed if several are up. ``cameras``: instead, those of
    several, which see each step together.

    >>> plan = Plan(
    ...     method="gaussian",
    ...     monitors=[PlanMonitor("back")],
    ...     sweeps=[Sweep(angle, sigma_px=4) for angle in (0, 90, 45, -45)],
    ...     solids=[Solid(BLACK), Solid(WHITE)],
    ...     square_waves=SquareWaves(levels=7),
    ... )
    """

    method: str
    monitors: Sequence[PlanMonitor] = ()
    sweeps: Sequence[Sweep] = ()
    solids: Sequence[Solid] = ()
    square_waves: SquareWaves | None = None
    ramp: Ramp | None = None
    photos: Sequence[Photo] = ()
    hold_refreshes: int | None = None
    exposure_ms: Sequence[float] = ()
    retries: int | None = None
    skip_empty_stage: bool = False
    calibration: CalibrationFrames | None = None
    white_every: int | None = None
    fringes: Sequence[Fringes] = ()
    camera: str = ""
    cameras: Sequence[str] = ()
    adapt: Adapt | None = None
    rounds: Sequence[Round] = ()

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Plan:
        """Reads a .txtpb file; its photos are found beside it. NotFound, or InvalidInput naming file and line."""
        file = pathlib.Path(path)
        try:
            text = file.read_text(encoding="utf-8")
        except FileNotFoundError:
            raise NotFound(f"{file}: there is no such file") from None
        except (OSError, UnicodeDecodeError) as error:
            raise InvalidInput(f"{file}: it cannot be read: {error}") from None
        plan = cls.parse(text, name=str(file))
        photos = [dataclasses.replace(photo, file=str(file.parent / photo.file)) for photo in plan.photos]
        return dataclasses.replace(plan, photos=tuple(photos))

    @classmethod
    def parse(cls, text: str, name: str = "plan") -> Plan:
        """Parses the text of a .txtpb file. InvalidInput names ``name`` and the line."""
        try:
            message = text_format.Parse(text, plan_pb2.Plan())
        except text_format.ParseError as error:
            raise InvalidInput(f"{name}:{error}") from None
        return cls.from_message(message)

    def text(self) -> str:
        """The plan as the text of a .txtpb file."""
        return str(text_format.MessageToString(self.to_message()))

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes a .txtpb file, which ``glasswing capture`` can also read."""
        pathlib.Path(path).write_text(self.text(), encoding="utf-8")

    @classmethod
    def from_message(cls, message: plan_pb2.Plan) -> Plan:
        """Converts a wire message."""
        return typing.cast(Plan, _value_of(cls, message))

    def to_message(self) -> plan_pb2.Plan:
        """The plan as a wire message. InvalidInput: a value has the wrong type."""
        message = plan_pb2.Plan()
        _fill(message, self, "")
        return message


# The classes above have the messages' fields under the same names; tuples are repeated fields.


def _fill(message: typing.Any, value: typing.Any, path: str) -> None:
    for field in dataclasses.fields(value):
        part = getattr(value, field.name)
        where = path + field.name
        try:
            if part is None:
                continue
            if dataclasses.is_dataclass(part):
                nested = getattr(message, field.name)
                nested.SetInParent()
                _fill(nested, part, f"{where}.")
            elif not isinstance(part, str) and isinstance(part, Sequence):
                repeated = getattr(message, field.name)
                for index, item in enumerate(part):
                    if dataclasses.is_dataclass(item):
                        _fill(repeated.add(), item, f"{where}[{index}].")
                    else:
                        repeated.append(item)
            else:
                setattr(message, field.name, part)
        except (AttributeError, TypeError, ValueError):
            raise InvalidInput(f"{where} is {part!r}; it must be of type {field.type}") from None


def _value_of(cls: type, message: typing.Any) -> typing.Any:
    types = typing.get_type_hints(cls)
    values: dict[str, typing.Any] = {}
    for descriptor, part in message.ListFields():
        repeated = descriptor.label == descriptor.LABEL_REPEATED
        if descriptor.message_type is None:
            values[descriptor.name] = tuple(part) if repeated else part
            continue
        item = _class_in(types[descriptor.name])
        values[descriptor.name] = tuple(_value_of(item, each) for each in part) if repeated else _value_of(item, part)
    return cls(**{**_zeros(cls, message), **values})


def _class_in(hint: typing.Any) -> type:
    """The dataclass in "Sequence[Sweep]" or "Ramp | None"."""
    return typing.cast(type, next(arg for arg in typing.get_args(hint) if dataclasses.is_dataclass(arg)))


def _zeros(cls: type, message: typing.Any) -> dict[str, typing.Any]:
    """Fields without a default that the wire leaves out because they are 0 or empty."""
    required = [f.name for f in dataclasses.fields(cls) if f.default is dataclasses.MISSING]
    found = {name: getattr(message, name) for name in required}
    return {name: part if isinstance(part, (str, int, float)) else tuple(part) for name, part in found.items()}
