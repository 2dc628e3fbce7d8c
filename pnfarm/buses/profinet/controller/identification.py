"""A drive's identity: I&M0 to I&M3 (PI profile guideline 1), read once a connection is established.

Reading must not disturb: of all drives of a controller only a few are read at once, and one alone while others are
being connected.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.controller.events import IdentificationDiffers, IdentificationUnread
from pnfarm.buses.profinet.controller.identity import read_im
from pnfarm.errors import DecodeError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profinet.controller.identity import Identification
    from pnfarm.buses.profinet.controller.records import RecordJob, RecordJobs
    from pnfarm.buses.profinet.controller.session import DeviceSession
    from pnfarm.station.event_log import EventLog

__all__ = ["IM0_INDEX", "IdentificationReader"]

IM0_INDEX = 0xAFF0
#: Drives that are read at once; while others are being connected, one.
UNDER_WAY = 4
#: Octets of I&M0 to I&M4 with their block's header, the longest of them.
IM_LENGTH = 64


class IdentificationReader:
    """``connecting`` says whether some drive is being connected just now."""

    def __init__(self, jobs: RecordJobs, log: EventLog, connecting: Callable[[], bool]) -> None:
        self._jobs = jobs
        self._log = log
        self._connecting = connecting
        self._waiting: deque[DeviceSession] = deque()
        self._under_way: dict[str, DeviceSession] = {}

    def request(self, session: DeviceSession) -> None:
        """This drive's connection is established: read it when its turn comes."""
        if session.plan.read_identification and session not in self._waiting:
            self._waiting.append(session)

    def pump(self, now: int) -> bool:
        """Begin with as many of those that wait as may be read at once; false when none began."""
        began = False
        while self._waiting and len(self._under_way) < (1 if self._connecting() else UNDER_WAY):
            session = self._waiting.popleft()
            if session.plan.name not in self._under_way:
                self._under_way[session.plan.name] = session
                self._ask(session, 0, now)
                began = True
        return began

    def _ask(self, session: DeviceSession, number: int, now: int) -> None:
        first = min((s for s in session.plan.submodules if s.slot == 0), key=lambda s: s.subslot, default=None)
        place = (0, 0, 1 if first is None else first.subslot, IM0_INDEX + number)
        self._jobs.read(
            session, place, now, length=IM_LENGTH, then=lambda job, at: self._took(session, number, job, at)
        )

    def _took(self, session: DeviceSession, number: int, job: RecordJob, now: int) -> None:
        known = session.identification if number else None
        failure = job.failure
        if job.data is not None:
            try:
                session.identification = known = read_im(known, job.data)
            except DecodeError as exc:
                failure = str(exc)
            else:
                if number == 0:
                    self._compare(session, known, now)
        if failure:
            self._log.record(now, session.plan.name, IdentificationUnread(failure))
        following = next((n for n in range(number + 1, 5) if known is not None and known.im_supported >> n & 1), None)
        if following is None or job.data is None:
            del self._under_way[session.plan.name]
        else:
            self._ask(session, following, now)

    def _compare(self, session: DeviceSession, known: Identification, now: int) -> None:
        """Warn about another drive than the plan's; it may be an equivalent spare part."""
        plan = session.plan
        if known.vendor_id != plan.vendor_id:
            self._warn(session, "vendor", f"0x{known.vendor_id:04X}", f"0x{plan.vendor_id:04X}", now)
        if plan.serial_number and known.serial_number != plan.serial_number:
            self._warn(session, "serial number", known.serial_number, plan.serial_number, now)

    def _warn(self, session: DeviceSession, what: str, found: str, planned: str, now: int) -> None:
        self._log.record(now, session.plan.name, IdentificationDiffers(what, found, planned))
