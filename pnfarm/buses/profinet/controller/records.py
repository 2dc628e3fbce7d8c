"""Record accesses on request: each a job, from the request to its end.

A job waits in the queue of its drive's connection, one call at a time.  It ends with data, with the drive's status, or
with a reason: no connection, its end, no answer in time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.protocols.profinet.cm.controller.events import RecordRead, RecordWriteDone
from pnfarm.protocols.profinet.errors import PnioStatus, describe_status

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profinet.controller.session import DeviceSession

__all__ = ["READ_LENGTH", "RecordJob", "RecordJobs", "RecordPlace"]

#: Octets that a read accepts by default.
READ_LENGTH = 4096

#: API, slot, subslot and index.
RecordPlace = tuple[int, int, int, int]


@dataclass(slots=True, eq=False)
class RecordJob:
    """One read or write; the results are valid once it is ``done``.

    ``status`` is the drive's, None when it gave none; ``failure`` why the job failed, empty when it did not.  ``then``
    is called once, with the job and the time, when it ends.
    """

    drive: str
    place: RecordPlace
    data: bytes | None = None
    status: PnioStatus | None = None
    failure: str = ""
    done: bool = False
    then: Callable[[RecordJob, int], None] | None = None

    @property
    def ok(self) -> bool:
        return self.done and not self.failure

    @property
    def code(self) -> int:
        """See :class:`pnfarm.buses.controller.RecordAccess`."""
        return 0 if self.status is None else int(self.status)


class RecordJobs:
    """The open jobs of one controller; ``touch`` is called with each session that has something to send."""

    def __init__(self, touch: Callable[[DeviceSession], object]) -> None:
        self._touch = touch
        self._open: dict[int, set[RecordJob]] = {}

    def read(
        self,
        session: DeviceSession,
        place: RecordPlace,
        now: int,
        *,
        length: int = READ_LENGTH,
        implicit: bool = False,
        then: Callable[[RecordJob, int], None] | None = None,
    ) -> RecordJob:
        """Read a record in the drive's AR, or without one (``implicit``)."""
        job = RecordJob(session.plan.name, place, then=then)
        if self._begin(session, job, now) and session.machine is not None:
            read = session.machine.read_implicit if implicit else session.machine.read_record
            read(job, *place, length)
        return job

    def write(
        self,
        session: DeviceSession,
        place: RecordPlace,
        data: bytes,
        now: int,
        *,
        then: Callable[[RecordJob, int], None] | None = None,
    ) -> RecordJob:
        """Write a record in the drive's AR."""
        job = RecordJob(session.plan.name, place, then=then)
        if self._begin(session, job, now) and session.machine is not None:
            session.machine.write_record(job, *place, data)
        return job

    def _begin(self, session: DeviceSession, job: RecordJob, now: int) -> bool:
        if session.machine is None:
            self._end(job, now, failure=f"there is no connection (state {session.state})")
            return False
        self._open.setdefault(session.index, set()).add(job)
        self._touch(session)
        return True

    def take(self, session: DeviceSession, event: RecordRead | RecordWriteDone, now: int) -> bool:
        """The end of a record call; false when it is not a job's."""
        job = event.tag
        if not isinstance(job, RecordJob):
            return False
        self._open.get(session.index, set()).discard(job)
        failure = event.reason
        if event.status is not None and not event.status.ok:
            failure = describe_status(event.status)
        data = event.data if isinstance(event, RecordRead) else None
        self._end(job, now, data=data, status=event.status, failure=failure)
        return True

    def forget(self, session: DeviceSession, now: int) -> None:
        """The session's machine ends: its open jobs get no answer."""
        for job in self._open.pop(session.index, set()):
            self._end(job, now, failure="the connection ended")

    def _end(
        self,
        job: RecordJob,
        now: int,
        *,
        data: bytes | None = None,
        status: PnioStatus | None = None,
        failure: str = "",
    ) -> None:
        if job.done:
            return
        job.data, job.status, job.failure, job.done = data, status, failure, True
        if job.then is not None:
            job.then(job, now)
