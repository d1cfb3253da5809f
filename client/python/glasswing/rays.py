"""Rays: for every camera pixel, along which lines its light came, whatever is behind the object.

    C = F + sum over rays of weight * light of a bundle

per colour channel. A bundle has origin + u origin_spread[0] + v origin_spread[1] and direction + u direction_spread[0]
+ v direction_spread[1], u and v independent with standard deviation 1; docs/rays.md has every convention. The frame is the
camera's: origin at its centre of projection, x right, y down, z forward, mm. Camera pixel (x, y) is the array's [y, x];
its centre is at (x + 0.5, y + 0.5).
"""

from __future__ import annotations

import dataclasses
import enum
import math
import os
import warnings
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from glasswing import _native
from glasswing._native import NativeRays
from glasswing.errors import Damaged, InvalidInput, Refused
from glasswing.matte import Matte
from glasswing.pictures import Picture, as_picture
from glasswing.pixels import Pixels
from glasswing.v1 import rays_pb2

_Floats = npt.NDArray[np.float32]
_Doubles = npt.NDArray[np.float64]
_MAX_DEPTH_MM = 1e7


def _tell_lost(*mattes: Matte) -> None:
    for matte in mattes:
        if lost := matte._native.lost_text("rays"):
            warnings.warn(lost, stacklevel=3)


def read_geometry(path: str | os.PathLike[str]) -> rays_pb2.RigGeometry:
    """Reads the file of "glasswing calibrate geometry": the message RigGeometry. NotFound, or InvalidInput naming the line."""
    geometry: rays_pb2.RigGeometry = rays_pb2.RigGeometry.FromString(_native.read_geometry(os.fspath(path)))
    return geometry


class RayState(enum.IntEnum):
    """How a ray was found."""

    MATCHED = 0
    """Through places measured at both depths."""
    AMBIGUOUS = 1
    """The same, but another match was about as likely."""
    EXTRAPOLATED = 2
    """Measured at one depth; the direction is fitted to neighbours of the same path."""
    UNKNOWN = 3
    """Measured at one depth; no direction, only a spread of half a radian."""
    STRAIGHT = 4
    """Outside the object: the camera's own ray."""
    FAR_LIGHT = 5
    """From one matte: the direction from the object, assumed flat, to the place on the monitor."""


@dataclasses.dataclass(frozen=True)
class Correspondences:
    """Points on the near and the far monitor that a camera pixel saw through the object, one row per ray.

    Rows are in the order of pixels, row by row, channels and rays. The line through a row's two points is the ray that left
    the object.
    """

    pixel: npt.NDArray[np.int32]
    """N x 2: x (column) and y (row) of the camera pixel; its centre is at ``pixel + 0.5``."""
    channel: npt.NDArray[np.int32]
    """N: 0 red, 1 green, 2 blue."""
    ray: npt.NDArray[np.int32]
    """N: index of the ray in its pixel and channel; 0 is the one with the most light, over all states."""
    monitor: npt.NDArray[np.int32]
    """N: index in ``Rays.monitors``."""
    weight: _Floats
    """N: the fraction of the monitor's light that reaches the camera; several rays may share one mode's."""
    near_mm: _Doubles
    """N x 3: the point on the near monitor, camera frame."""
    far_mm: _Doubles
    """N x 3: the point on the far monitor."""
    near_px: _Doubles
    """N x 2: the near point in the monitor's pixels, from the outer corner of its top-left pixel."""
    far_px: _Doubles
    """N x 2: the far point in the monitor's pixels."""
    near_sd_mm: _Doubles
    """N: standard error of the near point, rms of two axes; 0: not known. Includes the pose's error, if the pose was
    calibrated."""
    far_sd_mm: _Doubles
    """N: the same for the far point."""
    state: npt.NDArray[np.uint8]
    """N: ``RayState.MATCHED`` or ``RayState.AMBIGUOUS``."""
    camera_matrix: _Doubles
    """3 x 3: for continuous pixels, so use ``pixel + 0.5`` with it in OpenCV's functions."""
    distortion: _Doubles
    """k1, k2, p1, p2, k3 of OpenCV."""

    def __len__(self) -> int:
        return len(self.pixel)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes all arrays to a compressed NumPy file under these names; the name should end in ".npz"."""
        np.savez_compressed(path, **{field.name: getattr(self, field.name) for field in dataclasses.fields(self)})


class _Plane:
    """The pixels of a monitor at one pose: X = R (x pitch, y pitch, 0) + t."""

    def __init__(self, pose: rays_pb2.MonitorPose) -> None:
        rotation = np.reshape(np.array(pose.rotation), (3, 3))
        self.corner = np.array(pose.translation_mm)
        self.axes, self.normal = rotation[:, :2], rotation[:, 2]
        self.pitch, self.size_px = pose.pitch_mm, np.array([pose.width_px, pose.height_px])

    def pixels_of(self, points: _Doubles) -> _Doubles:
        pixels: _Doubles = (points - self.corner) @ self.axes / self.pitch
        return pixels

    def miss(self, points: _Doubles) -> _Doubles:
        """How far points are from the monitor's face, mm."""
        pixels = self.pixels_of(points)
        beyond = np.maximum(np.maximum(-pixels, pixels - self.size_px), 0.0) * self.pitch
        distance: _Doubles = np.hypot(np.hypot(beyond[:, 0], beyond[:, 1]), (points - self.corner) @ self.normal)
        return distance

    def met(self, origins: _Doubles, directions: _Doubles) -> _Doubles:
        """How far along rays the plane is, mm for unit directions."""
        along: _Doubles = (self.corner - origins) @ self.normal / (directions @ self.normal)
        return along


class Rays(Pixels):
    """The rays of H x W camera pixels, written by "glasswing rays" or made by ``Rays.match()``.

    Its arrays are read-only views into one copy of the data, which they keep alive. Rays of a pixel and channel are sorted
    by weight; those of weight 0 are unused.
    """

    _native: NativeRays

    def __init__(self, native: NativeRays) -> None:
        self._native = native
        self.metadata = rays_pb2.RayMetadata.FromString(native.metadata)
        """The message RayMetadata (proto/glasswing/v1/rays.proto): geometry, poses, counts, approximation, first matte's
        metadata."""

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Rays:
        """Reads rays from a file. NotFound, or Damaged: truncated, altered or not a rays file. Both name the path."""
        return cls(NativeRays.read(os.fspath(path)))

    @classmethod
    def from_bytes(cls, content: bytes) -> Rays:
        """Decodes rays from a file's content. Damaged: truncated, altered or not a rays file."""
        return cls(NativeRays.decode(content))

    @classmethod
    def match(
        cls,
        one: Matte,
        other: Matte,
        geometry: rays_pb2.RigGeometry,
        *,
        poses: tuple[str, str] | None = None,
    ) -> Rays:
        """Makes rays from mattes of one object in front of monitors at two depths, as "glasswing rays" does.

        ``geometry``: what ``read_geometry()`` returns. ``poses``: names of its poses, one for each matte; None: the names of
        their sessions. Releases the GIL.

        InvalidInput: the mattes differ in size, contain boxes or do not match the geometry's camera, or their monitors are
        in one plane. NotFound: no such pose. Footprints of any shape are not in rays: a warning says how much they show.
        """
        _tell_lost(one, other)
        names = list(poses or (one.metadata.session, other.metadata.session))
        return cls(NativeRays.match(one._native, other._native, geometry.SerializeToString(), names))

    @classmethod
    def far_light(
        cls,
        matte: Matte,
        geometry: rays_pb2.RigGeometry,
        object_depth_mm: float,
        *,
        pose: str | None = None,
    ) -> Rays:
        """Makes rays from one matte, for a distant environment, as an approximation: its object is assumed flat.

        ``object_depth_mm``: its distance along the camera's axis. Other arguments, and errors: as for ``match()``.
        """
        _tell_lost(matte)
        name = pose or matte.metadata.session
        return cls(NativeRays.far_light(matte._native, geometry.SerializeToString(), name, object_depth_mm))

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the file that "glasswing rays" would; its name should end in ".exr"."""
        self._native.write(os.fspath(path))

    def __repr__(self) -> str:
        height, width, _, most = self.weight.shape
        return f"<rays of session {self.metadata.matte.session}, {width}x{height}, up to {most} a channel>"

    @property
    def geometry(self) -> rays_pb2.RigGeometry:
        """The message RigGeometry: the camera, all poses of monitors, and their standard errors."""
        geometry: rays_pb2.RigGeometry = self.metadata.geometry
        return geometry

    @property
    def poses(self) -> tuple[str, ...]:
        """Names in ``geometry.monitors`` of the near and the far pose; only one for rays from one matte."""
        return tuple(self.metadata.poses)

    @property
    def near_depth_mm(self) -> float:
        """Distance from the camera to the first monitor at the near pose, along its normal: a depth for ``composite()``."""
        plane = self._plane(self.poses[0], self.monitors[0])
        return float(plane.normal @ plane.corner)

    @property
    def monitors(self) -> tuple[str, ...]:
        """Names of the monitors that the light came from."""
        return tuple(monitor.name for monitor in self.metadata.matte.monitors)

    @property
    def camera_matrix(self) -> _Doubles:
        """3 x 3: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] for continuous pixels; OpenCV's cx and cy are smaller by 0.5."""
        camera = self.geometry.camera
        return np.array([[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]])

    @property
    def distortion(self) -> _Doubles:
        """k1, k2, p1, p2, k3, as in OpenCV."""
        camera = self.geometry.camera
        return np.array([camera.k1, camera.k2, camera.p1, camera.p2, camera.k3])

    @property
    def weight(self) -> _Floats:
        """H x W x 3 x rays: the fraction of the radiance that reaches the camera; 0: unused."""
        return self._native.weight

    @property
    def origin_mm(self) -> _Floats:
        """H x W x 3 x rays x 3: the place on the near monitor; for ``STRAIGHT`` rays the camera, for ``FAR_LIGHT`` the
        object."""
        return self._native.origin_mm

    @property
    def direction(self) -> _Floats:
        """H x W x 3 x rays x 3: a unit vector away from the object."""
        return self._native.direction

    @property
    def origin_spread_mm(self) -> _Floats:
        """H x W x 3 x rays x 2 x 3: how the origin moves with u and with v."""
        return self._native.origin_spread_mm

    @property
    def direction_spread(self) -> _Floats:
        """H x W x 3 x rays x 2 x 3: how the direction moves with u and with v."""
        return self._native.direction_spread

    @property
    def origin_sd_mm(self) -> _Floats:
        """H x W x 3 x rays: standard error of the origin across the ray, rms of two axes; 0: not known.

        It combines those of the mode's position and of the pose, if the geometry has its covariance; so does
        ``direction_sd``.
        """
        return self._native.origin_sd_mm

    @property
    def direction_sd(self) -> _Floats:
        """H x W x 3 x rays: standard error of the direction, rad, rms of two axes; 0: not known."""
        return self._native.direction_sd

    @property
    def state(self) -> npt.NDArray[np.uint8]:
        """H x W x 3 x rays: a ``RayState``."""
        return self._native.state

    def composite(
        self,
        *,
        planes: Sequence[tuple[float, npt.ArrayLike]] = (),
        environment: npt.ArrayLike | None = None,
        environment_turn_deg: float = 0.0,
        lossless: bool = False,
        exact: bool = False,
        threads: int = 0,
    ) -> Picture:
        """Composites the object over pictures at any depth and in an environment: H x W x 3, linear, not clamped.

        ``planes``: depths and pictures of linear light, h x w x 3. Each is parallel to the nearest monitor, at this depth
        (mm) from the camera along its normal, and is scaled to the monitor's size; nearer ones hide those behind them.
        ``environment``: all directions, equirectangular; its centre is straight ahead of the camera, and moves to the right
        by ``environment_turn_deg``. ``lossless``: light that no ray accounts for is taken from the environment's mean.
        ``exact`` and ``threads``: as for ``Matte.composite()``. Releases the GIL.

        InvalidInput: nothing is behind the object, a depth is not in (0, 1e7], a picture is not linear light, or
        ``lossless`` has no environment.
        """
        if not planes and environment is None:
            raise InvalidInput("planes or environment must be given as the picture behind the object")
        if lossless and environment is None:
            raise InvalidInput("lossless needs an environment, which is not given")
        for depth, _ in planes:
            if not 0.0 < depth <= _MAX_DEPTH_MM:
                raise InvalidInput(f"a plane has the depth {depth} mm; it must be above 0 and at most {_MAX_DEPTH_MM:g}")
        pictures = [(float(depth), as_picture(picture, f"plane {depth:g}")) for depth, picture in planes]
        around = None if environment is None else as_picture(environment, "environment")
        turn_rad = math.radians(environment_turn_deg)
        return self._native.composite(pictures, around, turn_rad, lossless, exact, threads).view(Picture)

    def correspondences(self) -> Correspondences:
        """The pairs of points on the two monitors for all rays that were measured at both depths.

        Refused: the rays are from one matte. Damaged: the file lacks a pose that it names.
        """
        if len(self.poses) != 2:
            what = self.metadata.approximation or f"{len(self.poses)} poses"
            raise Refused(f"correspondences need mattes at two depths; these rays are from one ({what})")
        rows = np.nonzero((self.weight > 0.0) & (self.state <= RayState.AMBIGUOUS))
        near_mm = self.origin_mm[rows].astype(np.float64)
        direction = self.direction[rows].astype(np.float64)
        near, far = ([self._plane(pose, name) for name in self.monitors] for pose in self.poses)
        # The file does not say which monitor a ray starts from.
        monitor = np.argmin([plane.miss(near_mm) for plane in near], axis=0)
        along = np.choose(monitor, [plane.met(near_mm, direction) for plane in far])
        far_mm = near_mm + along[:, None] * direction
        near_px, far_px = np.empty((2, len(monitor), 2))
        for index, planes in enumerate(zip(near, far)):
            here = monitor == index
            near_px[here], far_px[here] = planes[0].pixels_of(near_mm[here]), planes[1].pixels_of(far_mm[here])
        # The direction's standard error is that of the difference between both points.
        near_sd = self.origin_sd_mm[rows].astype(np.float64)
        both_sd = self.direction_sd[rows] * along
        y, x, channel, ray = (index.astype(np.int32) for index in rows)
        return Correspondences(
            pixel=np.stack([x, y], axis=1),
            channel=channel,
            ray=ray,
            monitor=monitor.astype(np.int32),
            weight=self.weight[rows],
            near_mm=near_mm,
            far_mm=far_mm,
            near_px=near_px,
            far_px=far_px,
            near_sd_mm=near_sd,
            far_sd_mm=np.sqrt(np.maximum(both_sd**2 - near_sd**2, 0.0)),
            state=self.state[rows],
            camera_matrix=self.camera_matrix,
            distortion=self.distortion,
        )

    def _plane(self, name: str, monitor: str) -> _Plane:
        for pose in self.geometry.monitors:
            if pose.name == name and pose.monitor in ("", monitor):
                return _Plane(pose)
        raise Damaged(f'the rays are of pose "{name}" of monitor {monitor}, which their geometry does not have')
