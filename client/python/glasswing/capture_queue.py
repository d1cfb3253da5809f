"""The queue of captures that the server runs one after the other, without this program."""

from __future__ import annotations

import dataclasses
import datetime
import enum
import os
import uuid
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from glasswing import pictures
from glasswing.connection import LONG_CALL_SECONDS, Connection
from glasswing.errors import TimedOut
from glasswing.plan import Plan
from glasswing.v1 import queue_service_pb2 as pb
from glasswing.v1.queue_service_pb2_grpc import QueueServiceStub


class ItemState(enum.Enum):
    """What becomes of an item."""

    WAITING = pb.QUEUE_ITEM_STATE_WAITING
    RUNNING = pb.QUEUE_ITEM_STATE_RUNNING
    PAUSED = pb.QUEUE_ITEM_STATE_PAUSED
    """Its session waits for a person, and the queue with it."""
    SOLVING = pb.QUEUE_ITEM_STATE_SOLVING
    """Captured; the next item runs meanwhile."""
    DONE = pb.QUEUE_ITEM_STATE_DONE
    FAILED = pb.QUEUE_ITEM_STATE_FAILED


@dataclasses.dataclass(frozen=True)
class QueueItem:
    """A capture in the queue."""

    number: int
    state: ItemState
    session: str
    """The session that it became; empty: none yet."""
    pattern: str
    """Of the session's name."""
    added_by: str
    """The client that added it: "anna@lab3"."""
    reason: str
    """What it waits for, or why it failed, for people."""
    tries: int
    approved_by: str
    began: datetime.datetime | None
    ended: datetime.datetime | None

    @classmethod
    def from_message(cls, message: pb.QueueItem) -> QueueItem:
        """Converts a wire message."""
        return cls(
            number=message.number,
            state=ItemState(message.state),
            session=message.session,
            pattern=message.wish.session,
            added_by=message.added_by,
            reason=message.reason,
            tries=message.tries,
            approved_by=message.approved_by,
            began=_time(message.began),
            ended=_time(message.ended),
        )


@dataclasses.dataclass(frozen=True)
class QueueEvent:
    """Something that happened to the queue. ``item``: its number; 0: the whole queue."""

    time: datetime.datetime | None
    who: str
    """The client; empty: the queue itself."""
    item: int
    what: str


class CaptureQueue:
    """The queue of a rig; ``Rig.queue`` is it. Items are named by their numbers. NotFound: the queue has no such item. Refused:
    the item's state does not allow the call."""

    def __init__(self, connection: Connection, upload: Callable[[Any], str], upload_photos: Callable[[Any], None]) -> None:
        self._connection = connection
        self._stub = connection.stub(QueueServiceStub)
        self._upload, self._upload_photos = upload, upload_photos

    def add(
        self,
        plan: Plan,
        session: str = "",
        *,
        solve: bool = False,
        tags: Sequence[str] = (),
        note: str = "",
        rail_mm: Mapping[str, float] | None = None,
        axes: Mapping[str, float] | None = None,
        empty_stage_of: str = "",
        retries: int = 3,
        retry_wait: float = 60.0,
        approval: bool = False,
        doctor: bool = False,
        no_warnings: bool = False,
        steady: bool = False,
        not_before: datetime.datetime | None = None,
        warm_up: float = 0.0,
        give_up: float = 0.0,
        retake_unusual: bool = False,
        pause_after: bool = False,
        background: Mapping[str, str | os.PathLike[str]] | None = None,
        deadline: datetime.datetime | None = None,
    ) -> QueueItem:
        """Adds a capture to the end of the queue.

        ``session``: the name, in which {item} becomes the item's number, {date} and {time} those of its start. ``rail_mm``:
        where monitors shall stand. ``axes``: where the stage's axes put the object, degrees or mm. ``empty_stage_of``: a
        session of the same plan, whose frames of the empty stage are used if it is captured by then. ``retries``: how often
        a capture that broke off is tried again, ``retry_wait`` seconds later. It waits for an ``approval`` by a person;
        where the capture before saw the rig drift or touched, also with ``steady``; and until ``not_before`` (a time without
        a zone is local). ``doctor`` tests the rig before it, and ``no_warnings`` makes a dry run: what they find counts as a
        capture that broke off. ``warm_up``: seconds for which the monitors are white before. ``give_up``: seconds to wait for people, until the next one runs; 0: for ever.
        ``retake_unusual``: when no other item is left, it is captured once more if its figures are unusual for its series.
        ``pause_after``: the queue pauses then. ``background``: pictures by monitor ("": the first), over which the solved
        matte is composited; ``composite`` has the result. ``deadline``: when the solve should be done.
        InvalidInput: the plan or another argument; the message names it.
        """
        shown = plan.to_message()
        self._upload_photos(shown)
        wish = pb.QueueWish(
            session=session,
            plan=shown,
            background={name: self._upload(pictures.read_picture(file)) for name, file in (background or {}).items()},
            solve=solve,
            tags=list(tags),
            note=note,
            rail_mm=dict(rail_mm or {}),
            axes=dict(axes or {}),
            empty_stage_of=empty_stage_of,
            retries=retries,
            retry_wait_s=retry_wait,
            approval=approval,
            doctor=doctor,
            no_warnings=no_warnings,
            steady=steady,
            not_before=not_before.astimezone().isoformat() if not_before else "",
            warm_up_s=warm_up,
            give_up_s=give_up,
            retake_unusual=retake_unusual,
            pause_after=pause_after,
            deadline=deadline.astimezone().isoformat() if deadline else "",
        )
        request = pb.AddQueueItemRequest(request_id=uuid.uuid4().hex, wish=wish)
        try:
            answer: pb.AddQueueItemResponse = self._connection.call(self._stub.AddQueueItem, request)
        except TimedOut:  # the request id makes a retry safe if only the answer was lost
            answer = self._connection.call(self._stub.AddQueueItem, request)
        return QueueItem.from_message(answer.item)

    def composite(self, session: str) -> bytes:
        """The composite that an item with a ``background`` made of its session: an OpenEXR file. NotFound: it has none."""
        request = pb.FetchCompositeRequest(session=session)
        return b"".join(part.chunk for part in self._connection.stream(self._stub.FetchComposite, request, LONG_CALL_SECONDS))

    def hold(self, start: datetime.datetime, end: datetime.datetime, why: str = "") -> int:
        """Keeps the rig free for people: no item begins in that time, nor one that would not end before it. Returns the
        hold's number, for ``release``. A time without a zone is local. InvalidInput: it ends before it begins, or is over.
        """
        request = pb.HoldQueueRequest(why=why, to=end.astimezone().isoformat(), **{"from": start.astimezone().isoformat()})
        answer: pb.HoldQueueResponse = self._connection.call(self._stub.HoldQueue, request)
        return answer.hold.number

    def release(self, number: int) -> None:
        """Takes such a time back. NotFound: there is no such hold."""
        self._connection.call(self._stub.ReleaseQueue, pb.ReleaseQueueRequest(number=number))

    def items(self, *, ended: bool = False) -> list[QueueItem]:
        """The items in the order of work; ``ended``: also those that are done or failed."""
        answer: pb.GetQueueResponse = self._connection.call_pages(self._stub.GetQueue, pb.GetQueueRequest(ended=ended))
        return [QueueItem.from_message(item) for item in answer.items]

    def item(self, number: int) -> QueueItem:
        """The item of this number."""
        answer: pb.GetQueueItemResponse = self._connection.call(
            self._stub.GetQueueItem, pb.GetQueueItemRequest(number=number)
        )
        return QueueItem.from_message(answer.item)

    def move(self, number: int, *, before: int = 0) -> None:
        """Moves an item that waits before another one, or to the end."""
        self._connection.call(self._stub.MoveQueueItem, pb.MoveQueueItemRequest(number=number, before=before))

    def duplicate(self, number: int) -> QueueItem:
        """Adds a copy of an item to the end."""
        request = pb.DuplicateQueueItemRequest(request_id=uuid.uuid4().hex, number=number)
        answer: pb.DuplicateQueueItemResponse = self._connection.call(self._stub.DuplicateQueueItem, request)
        return QueueItem.from_message(answer.item)

    def remove(self, number: int) -> None:
        """Removes an item that is not being captured; its session stays."""
        self._connection.call(self._stub.RemoveQueueItem, pb.RemoveQueueItemRequest(number=number))

    def run(self, number: int) -> None:
        """Runs an item next, also while the queue is paused, and approves it."""
        self._connection.call(self._stub.RunQueueItem, pb.RunQueueItemRequest(number=number))

    def approve(self, number: int) -> None:
        """Approves an item that waits."""
        self._connection.call(self._stub.ApproveQueueItem, pb.ApproveQueueItemRequest(number=number))

    @property
    def running(self) -> bool:
        """False: it is paused, and begins no further item."""
        answer: pb.GetQueueResponse = self._connection.call(self._stub.GetQueue, pb.GetQueueRequest(page_size=1))
        return answer.queue.running

    def start(self) -> None:
        """Runs what the queue has, and what is added later."""
        self._connection.call(self._stub.SetQueue, pb.SetQueueRequest(running=True))

    def pause(self) -> None:
        """Begins no further item; the running one goes on."""
        self._connection.call(self._stub.SetQueue, pb.SetQueueRequest(running=False))

    def history(self, number: int = 0) -> list[QueueEvent]:
        """Who did what to the queue, or to one item, when, and why; newest first."""
        answer: pb.ListQueueHistoryResponse = self._connection.call_pages(
            self._stub.ListQueueHistory, pb.ListQueueHistoryRequest(item=number)
        )
        return [QueueEvent(_time(event.time), event.who, event.item, event.what) for event in answer.events]


def _time(text: str) -> datetime.datetime | None:
    return datetime.datetime.fromisoformat(text) if text else None
