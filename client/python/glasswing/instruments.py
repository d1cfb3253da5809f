"""The results of a rig's checks and measurements: findings of the doctor, latencies of monitors, live pictures of a
camera."""

from __future__ import annotations

import dataclasses
import enum

from glasswing.v1 import calibration_pb2, camera_service_pb2, rig_service_pb2


class Level(enum.Enum):
    """How bad a finding is."""

    OK = rig_service_pb2.FINDING_LEVEL_OK
    WARNING = rig_service_pb2.FINDING_LEVEL_WARNING
    """A capture works, but slower or less reliably."""
    PROBLEM = rig_service_pb2.FINDING_LEVEL_PROBLEM
    """A capture would fail."""


@dataclasses.dataclass(frozen=True)
class Finding:
    """One finding of ``Rig.doctor()``."""

    level: Level
    subject: str
    """"clocks", "camera", "window", ..."""
    text: str
    advice: str
    """What to change; empty: nothing."""

    @classmethod
    def from_message(cls, message: rig_service_pb2.Finding) -> Finding:
        """Converts a wire message."""
        return cls(Level(message.level), message.subject, message.text, message.advice)

    def __str__(self) -> str:
        line = f"{self.level.name.lower()}: {self.subject}: {self.text}"
        return f"{line} -> {self.advice}" if self.advice else line


@dataclasses.dataclass(frozen=True)
class MonitorLatency:
    """When a monitor's light follows its scan-out, in milliseconds."""

    monitor: str
    lag_ms: float
    """Until the first light."""
    settling_ms: float
    """From there to the final light."""
    error_ms: float

    @classmethod
    def from_message(cls, message: calibration_pb2.MonitorSync) -> MonitorLatency:
        """Converts a wire message."""
        return cls(message.monitor, message.lag_ns / 1e6, message.settle_ns / 1e6, message.error_ns / 1e6)


@dataclasses.dataclass(frozen=True)
class Calibration:
    """What ``Rig.calibrate()`` measured and stored; later sessions use it."""

    latencies: tuple[MonitorLatency, ...]
    camera: calibration_pb2.CameraCalibration | None
    """The message CameraCalibration (proto/glasswing/v1/calibration.proto); None: there was nothing to measure."""
    displays: tuple[calibration_pb2.DisplayCalibration, ...]
    notes: tuple[str, ...]
    """For display: what was left out, and what makes it less certain."""


@dataclasses.dataclass(frozen=True)
class LivePicture:
    """A small picture of the camera's current view. Notebooks show it."""

    jpeg: bytes = dataclasses.field(repr=False)
    width_px: int
    height_px: int
    focus: float
    """0 to 1: 1 is an edge as sharp as the pixels, 0.5 one blurred by about a pixel. 0 if it cannot be judged."""
    focus_hint: str
    """Why focus cannot be judged, and what to do; otherwise empty."""
    clipped_fraction: float
    """Fraction of the samples at full scale."""
    mean: float
    """Linear radiance."""
    exposure_ms: float

    @classmethod
    def from_message(cls, message: camera_service_pb2.PreviewResponse) -> LivePicture:
        """Converts a wire message."""
        return cls(
            message.jpeg,
            message.width_px,
            message.height_px,
            message.focus,
            message.focus_hint,
            message.clipped_fraction,
            message.mean,
            message.exposure_ms,
        )

    def _repr_jpeg_(self) -> bytes:
        return self.jpeg
