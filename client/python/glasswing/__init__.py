"""Glasswing from Python: drives a rig, and composites the captured object over other pictures.

    import glasswing

    with glasswing.connect("127.0.0.1:7440") as rig:
        session = rig.capture(glasswing.Plan.read("crystal.txtpb"), name="vase")
        for event in session.events():
            print(f"{event.steps_proven} of {event.steps}")
        session.solve()
        session.wait()
        matte = session.fetch()

    picture = matte.composite({"back": glasswing.read_picture("harbour.png")})
    glasswing.write_picture("vase.png", picture)

Every failure raises an ``Error`` whose text is one line and says what to do.
"""

# Imported first: a message class already made by Python would differ from the one in this module.
try:
    from glasswing import _native as _native
    from glasswing import matte as matte
    from glasswing import rig as rig
except ModuleNotFoundError as missing:
    import sys

    raise ImportError(
        f"{missing}: glasswing runs in Debian's Python, /usr/bin/python3, with its python3-grpcio and python3-numpy; this is "
        f"{sys.executable}"
    ) from None
from glasswing.capture_queue import CaptureQueue, ItemState, QueueEvent, QueueItem
from glasswing.errors import (
    AlreadyExists,
    Damaged,
    Error,
    InvalidInput,
    NotAllowed,
    NotFound,
    NotSupported,
    Refused,
    TimedOut,
    Unavailable,
)
from glasswing.fleet import Fleet, Lease, Solve, Solver
from glasswing.frames import Frame, Frames
from glasswing.instruments import Calibration, Finding, Level, LivePicture, MonitorLatency
from glasswing.live import LiveComposite
from glasswing.matte import Matte, Modes, Transport
from glasswing.pictures import ErrorMap, Picture, linear_to_srgb, read_picture, resized, srgb_to_linear, write_picture
from glasswing.pixels import PixelFlag
from glasswing.plan import (
    BLACK,
    WHITE,
    Adapt,
    CalibrationFrames,
    Colour,
    Fringes,
    Photo,
    Plan,
    PlanMonitor,
    Ramp,
    Round,
    Solid,
    SquareWaves,
    Sweep,
)
from glasswing.rays import Correspondences, Rays, RayState, read_geometry
from glasswing.rig import Estimate, Holder, Monitor, Node, NodeKind, Preparation, Rig, connect
from glasswing.session import Action, Draft, RigChange, Session, SessionInfo, State, Stopped, UnprovenStep, Waiting
from glasswing.stage import Axis, Stage, object_to_rig

__version__ = "@glasswing_VERSION@"

__all__ = [
    "BLACK",
    "WHITE",
    "Action",
    "Adapt",
    "AlreadyExists",
    "Axis",
    "Calibration",
    "CalibrationFrames",
    "CaptureQueue",
    "Colour",
    "Correspondences",
    "Damaged",
    "Draft",
    "Error",
    "ErrorMap",
    "Estimate",
    "Finding",
    "Fleet",
    "Frame",
    "Frames",
    "Fringes",
    "Holder",
    "InvalidInput",
    "ItemState",
    "Lease",
    "Level",
    "LiveComposite",
    "LivePicture",
    "Matte",
    "Modes",
    "Monitor",
    "MonitorLatency",
    "Node",
    "NodeKind",
    "NotAllowed",
    "NotFound",
    "NotSupported",
    "Photo",
    "Picture",
    "PixelFlag",
    "Plan",
    "PlanMonitor",
    "Preparation",
    "QueueEvent",
    "QueueItem",
    "Ramp",
    "RayState",
    "Rays",
    "Refused",
    "Rig",
    "RigChange",
    "Round",
    "Session",
    "SessionInfo",
    "Solid",
    "Solve",
    "Solver",
    "SquareWaves",
    "Stage",
    "State",
    "Stopped",
    "Sweep",
    "TimedOut",
    "Transport",
    "Unavailable",
    "UnprovenStep",
    "Waiting",
    "connect",
    "linear_to_srgb",
    "object_to_rig",
    "read_geometry",
    "read_picture",
    "resized",
    "srgb_to_linear",
    "write_picture",
]
