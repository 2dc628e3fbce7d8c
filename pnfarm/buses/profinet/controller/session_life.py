"""The life of each session: its signs and their actions, and the events of its AR machine."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.session_life import Life
from pnfarm.buses.profinet.controller import events
from pnfarm.buses.profinet.controller.identification import IdentificationReader
from pnfarm.buses.profinet.controller.records import RecordJobs
from pnfarm.buses.profinet.controller.session import TRANSITIONS, DeviceSession, SessionState, Sign
from pnfarm.protocols.profinet.cm.controller.cmctl import CmController, CmctlState
from pnfarm.protocols.profinet.cm.controller.events import (
    AlarmIndicated,
    ApplicationReadyReceived,
    ArAborted,
    ArEstablished,
    ArFailed,
    ArReleased,
    Connected,
    ParametersEnded,
    Parametrised,
    RecordRead,
    RecordWriteDone,
    SubmodulesChanged,
)
from pnfarm.protocols.profinet.errors import describe_status
from pnfarm.protocols.profinet.wire.alarms.texts import only_disappears
from pnfarm.protocols.profinet.wire.cm.connect import AlarmCrBlockReq

if TYPE_CHECKING:
    from collections.abc import Callable
    from enum import StrEnum
    from uuid import UUID

    from pnfarm.buses.profinet.controller.channels import SessionChannels
    from pnfarm.buses.profinet.controller.search import Search
    from pnfarm.engine.columns import Columns
    from pnfarm.station.event_log import EventLog

__all__ = ["SessionLife"]

#: ARs count their activity timeout in 100 ms, to 1000: a start-up that hangs is given up by the device after this.
ACTIVITY_TIMEOUT = 200
LONGEST_ACTIVITY_TIMEOUT = 1000
#: A drive's first cyclic frame must come within this time after the end of its parametrisation: devices send from
#: Connect on.  One that does not has failed, however long its application may take.
FIRST_DATA_NS = 2_000_000_000
#: Ends of record accesses that are kept, see :attr:`ProfinetCore.records`.
KEPT_RECORDS = 64
#: Start-ups that are under way at once.  More of them take no less time, and answers that come late bring repetitions.
STARTING = 128


class SessionLife(Life[DeviceSession]):
    """``name``, ``mac`` and ``object_uuid`` are the controller's, which passes on the events of machines."""

    transitions = TRANSITIONS

    def __init__(
        self,
        name: str,
        mac: bytes,
        object_uuid: UUID,
        *,
        columns: Columns,
        channels: SessionChannels,
        search: Search,
        log: EventLog,
        uuids: Callable[[], UUID],
    ) -> None:
        super().__init__(log)
        self._name = name
        self._mac = mac
        self._object_uuid = object_uuid
        self._columns = columns
        self._channels = channels
        self._search = search
        self._uuids = uuids
        self._session_key = 0
        self.by_call: dict[int, DeviceSession] = {}
        self.by_ar: dict[Any, DeviceSession] = {}
        self.by_mac: dict[bytes, DeviceSession] = {}
        #: Sessions whose start-up is under way, or waits for its turn.
        self.connecting = 0
        self._starting: set[int] = set()
        self._waiting: deque[DeviceSession] = deque()
        self.jobs = RecordJobs(self.touch)
        self.identification = IdentificationReader(self.jobs, log, lambda: self.connecting > 0)
        #: See :attr:`ProfinetCore.records`.
        self.records: deque[tuple[int, RecordRead | RecordWriteDone]] = deque(maxlen=KEPT_RECORDS)

    def moved(self, session: DeviceSession, before: StrEnum) -> None:
        self.connecting += (session.state is SessionState.CONNECT) - (before is SessionState.CONNECT)
        if session.state is not SessionState.CONNECT:
            self._starting.discard(session.index)

    def timed(self, session: DeviceSession, now: int) -> None:
        self.sign(session, Sign.TIME, now)

    def expired(self, session: DeviceSession, now: int) -> None:
        # those of several CRs may come at once, and the first one ends the connection
        if session.machine is not None and session.machine.state is not CmctlState.CLOSED:
            session.measures.expirations += 1
            session.machine.watchdog_expired(now)
            self.touch(session)

    def begin_waiting(self, now: int) -> None:
        """Begin start-ups that wait for their turn, once all signs of this moment are taken."""
        while self._waiting and len(self._starting) < STARTING:
            session = self._waiting.popleft()
            # it may have been released, and have come again
            if session.state is SessionState.CONNECT and session.index not in self._starting:
                self._begin(session, now)
                self.touch(session)

    def _do_search(self, session: DeviceSession, now: int) -> None:
        session.measures.search_ns = now
        self._search.seek(session)

    def _do_address(self, session: DeviceSession, now: int) -> None:
        self._search.address(session, now)

    def _do_connect(self, session: DeviceSession, now: int) -> None:
        self._forget_machine(session, now)
        self._waiting.append(session)

    def _begin(self, session: DeviceSession, now: int) -> None:
        self._starting.add(session.index)
        self._session_key = self._session_key % 0xFFFF + 1
        plan = session.plan
        uuid = self._uuids()
        machine = CmController(
            plan.ar_plan(
                controller_name=self._name,
                controller_mac=self._mac,
                controller_object_uuid=self._object_uuid,
                ar_uuid=uuid,
                session_key=self._session_key,
                # a device that may take longer to be ready is not to give up before
                activity_timeout_factor=min(
                    LONGEST_ACTIVITY_TIMEOUT, max(ACTIVITY_TIMEOUT, plan.application_ready_ns // 100_000_000)
                ),
                phase=session.index % plan.reduction_ratio + 1,
                input_frame_id=session.frame_id,
                alarm_cr=AlarmCrBlockReq(local_alarm_reference=session.index + 1),
            ),
        )
        session.machine, session.ar_uuid = machine, uuid
        self.by_ar[uuid] = session
        self.by_mac[session.mac] = session
        machine.connect(now)

    def _do_established(self, session: DeviceSession, now: int) -> None:
        took = session.measures.established(now)
        for row in session.rows:
            self._columns.image[row].good = 1
        session.due_ns = now + FIRST_DATA_NS
        self.identification.request(session)
        self.note(session, events.Connected(took, session.mac), now)

    def _do_expect_data(self, session: DeviceSession, now: int) -> None:
        """The data hold timer runs from the first frame on: a drive that never sends one is found here."""
        silent = any(self._columns.cpm[row].received == 0 for row in session.consumers)
        if silent and session.machine is not None:
            session.machine.watchdog_expired(now)

    def _do_pause(self, session: DeviceSession, now: int) -> None:
        self._channels.close(session)
        self.pause(session, now)

    def _do_release(self, session: DeviceSession, now: int) -> None:
        if session.machine is None:
            # its start-up had not begun
            self.sign(session, Sign.RELEASED, now)
        else:
            session.machine.release(now)

    def _lost(self, session: DeviceSession, reason: str, now: int, *, established: bool) -> None:
        measures = session.measures
        measures.last_reason = reason
        if established:
            measures.losses += 1
        else:
            measures.refusals += 1
        if measures.lost_ns is None and measures.connects:
            measures.lost_ns = now
        event = events.ConnectionBroken(reason) if established else events.ConnectFailed(reason)
        self.note(session, event, now)
        self.sign(session, Sign.LOST, now)

    def _forget_machine(self, session: DeviceSession, now: int) -> None:
        self.jobs.forget(session, now)
        if session.ar_uuid is not None:
            self.by_ar.pop(session.ar_uuid, None)
        for call_id in session.calls:
            self.by_call.pop(call_id, None)
        session.calls.clear()
        session.machine = session.ar_uuid = None

    def take(self, session: DeviceSession, event: object, now: int) -> None:
        match event:
            case Connected(device_mac=mac) if mac != session.mac and session.machine is not None:
                # two stations have the drive's address, and the other one took the Connect
                text = f"{mac.hex(':')} has the address of {session.plan.name} ({session.mac.hex(':')}) and answered"
                session.machine.abort(now, reason=text)
                self.touch(session)
            case Connected():
                self._channels.open(session, event)
            case Parametrised():
                session.due_ns = now + FIRST_DATA_NS
                self.touch(session)
            case ApplicationReadyReceived(module_diff=deviations):
                for deviation in deviations:
                    self.note(session, events.ModuleDiffers(deviation.text), now)
            case AlarmIndicated(alarm=alarm, text=text):
                session.measures.alarms_received += 1
                session.measures.last_alarm = text
                received = events.AlarmReceived(text, high=alarm.high, gone=only_disappears(alarm))
                self.note(session, received, now)
            case SubmodulesChanged(unusable=unusable):
                session.unusable = dict(unusable)
                self._channels.relayout(session, session.unusable)
                self.note(session, events.SubmodulesChanged(session.out_of_use), now)
            case ParametersEnded(reason=reason):
                self.note(session, events.ParametersWritten(reason), now)
            case ArEstablished():
                self.sign(session, Sign.ESTABLISHED, now)
            case ArFailed(phase=phase, status=status, reason=reason):
                text = reason if status is None else describe_status(status)
                self._lost(session, f"{phase}: {text}", now, established=False)
            case ArAborted(reason=reason):
                self._lost(session, reason, now, established=True)
            case ArReleased():
                self._channels.close(session)
                self.note(session, events.Released(), now)
                self.sign(session, Sign.RELEASED, now)
            case RecordRead() | RecordWriteDone():
                if not self.jobs.take(session, event, now):
                    self.records.append((session.index, event))
