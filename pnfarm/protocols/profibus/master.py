"""A master of class 1 and 2: it polls its slaves one after the other, and asks for records between the polls.

Telegrams in, telegrams out, no line and no clock.  EN 50170 part 2: 4.7 (FDL), 8.2 and 9 (DP); guideline 2.082.
There is one master on the line: it keeps the token.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.master_access import Connection, failure
from pnfarm.protocols.profibus.master_slaves import (
    ConnectionMade,
    ConnectionMissed,
    DiagnosisRead,
    SlaveState,
    Station,
)
from pnfarm.protocols.profibus.wire.dp import (
    NO_MASTER,
    Control,
    Diagnosis,
    GlobalControl,
    Parameters,
    PrmStatus,
    StationStatus,
)
from pnfarm.protocols.profibus.wire.telegram import (
    BROADCAST,
    FCB,
    FCV,
    REQUEST,
    Answer,
    Request,
    Sap,
    ShortAck,
    Telegram,
    emit_telegram,
)
from pnfarm.protocols.profibus.wire.timing import SYN_BITS, answered_within_ns, bits_ns, line_ns

if TYPE_CHECKING:
    from pnfarm.protocols.profibus.master_slaves import MasterEvent, SlavePlan
    from pnfarm.protocols.profibus.record_request import RecordRequest
    from pnfarm.protocols.profibus.wire.telegram import Line

__all__ = ["Master", "MasterSettings"]

#: A slave that was never connected is tried again after this time, also where a lost one stays lost.
RETRY_NS: Final = 1_000_000_000
#: Readings of the diagnosis after Chk_Cfg until the slave has to be ready.
MOST_DIAGNOSES: Final = 50
#: Upper bounds of the histogram of answer times (Tsdr with the line's latency), ns; a last bucket takes the rest.
ANSWER_EDGES_NS: Final = (
    10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000, 2_000_000, 5_000_000, 10_000_000, 20_000_000,
    50_000_000,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class MasterSettings:
    """``latency_ns``: time beyond the bus's own that an answer may take.  ``cycle_ns``: least time of a cycle."""

    address: int = 1
    baud: int = 1_500_000
    latency_ns: int = 20_000_000
    retries: int = 1
    cycle_ns: int = 10_000_000
    min_tsdr_bits: int = 11
    request_timeout_ns: int = 5_000_000_000


@dataclass(slots=True)
class _Pending:
    """The request on its way."""

    station: Station | None
    telegram: Telegram
    octets: bytes
    acyclic: bool
    left: int
    due_ns: int = 0
    sent_ns: int = 0
    #: Its answer ends the master's work with the station.
    releases: bool = False


class Master:
    """See the module's docstring.

    :meth:`to_send` gives a request when the line is free for it; :meth:`sent` is called when it left.
    """

    def __init__(self, settings: MasterSettings, plans: list[SlavePlan]) -> None:
        self.settings = settings
        self.stations = [Station(plan) for plan in plans]
        self._of = {station.plan.name: station for station in self.stations}
        for station in self.stations:
            station.connection = Connection(station.plan.access, settings.request_timeout_ns)
            station.outputs = bytes(station.plan.output_octets)
        #: Of the line: requests, repetitions, answers, answers that cannot be used, by name.
        self.counts: Counter[str] = Counter()
        self.answer_times = [0] * (len(ANSWER_EDGES_NS) + 1)
        #: How long the last whole cycle took, ns.
        self.cycle_ns = 0
        self.clear = False
        self._queue: deque[Station] = deque()
        #: The slave whose request is repeated in this cycle, and requests of others that wait for such a cycle: silent
        #: slaves are to take little of the others' time.
        self._silent: Station | None = None
        self._again: deque[_Pending] = deque()
        self._pending: _Pending | None = None
        self._ready: _Pending | None = None
        self._control: GlobalControl | None = None
        self._cycle_ns = 0
        self._began_ns: int | None = None
        self._next_acyclic = 0
        self._acyclic_done = True
        self._free_ns = 0
        self._events: list[MasterEvent] = []
        self._released = False
        self._fresh: list[Station] = []

    # -- what the owner does -----------------------------------------------------------------------------------------

    def station(self, name: str) -> Station:
        """Raises :class:`KeyError`."""
        return self._of[name]

    def take_events(self) -> list[MasterEvent]:
        events, self._events = self._events, []
        return events

    def take_fresh(self) -> list[Station]:
        """Slaves whose inputs came since the last call."""
        fresh, self._fresh = self._fresh, []
        return fresh

    def ask(self, name: str, request: RecordRequest, now: int) -> None:
        """Ask a slave for a record; the request says when it is done."""
        station = self._of[name]
        if station.plan.access == "class-1" and station.state is not SlaveState.DATA:
            request.fail("the slave exchanges no data")
            return
        if station.state is SlaveState.STOPPED:
            request.fail(station.reason or "the slave is released")
            return
        station.connection.ask(request, now)

    def control(self, command: int, groups: int = 0) -> None:
        """Send Global_Control to all slaves, or to groups of them."""
        self._control = GlobalControl(command, groups)
        if not groups:
            self.clear = bool(command & Control.CLEAR_DATA)

    def release(self) -> None:
        """Release every slave: Set_Prm with Unlock_Req."""
        self._released = True
        for station in self.stations:
            if station.state in {SlaveState.WAITING, SlaveState.DIAGNOSIS}:
                station.state = SlaveState.STOPPED
                self._again = deque(one for one in self._again if one.station is not station)

    @property
    def all_stopped(self) -> bool:
        return all(station.state is SlaveState.STOPPED for station in self.stations)

    # -- time and the line -------------------------------------------------------------------------------------------

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due: an answer is missing, or the next request may leave."""
        if self._pending is not None:
            return self._pending.due_ns
        if self._ready is not None:
            return None
        return self._due()

    def _due(self) -> int | None:
        if self._queue or self._control is not None or (self._again and self._silent is None):
            return self._free_ns
        if self.all_stopped:
            return None
        if not self._acyclic_done and any(one.connection.busy for one in self.stations):
            return self._free_ns
        return max(self._free_ns, self._cycle_ns)

    def handle_timeout(self, now: int) -> None:
        """An answer that did not come; the next request."""
        pending = self._pending
        if pending is not None:
            if now < pending.due_ns:
                return
            self._missed(pending, now)
        if self._pending is None and self._ready is None:
            due = self._due()
            if due is not None and due <= now:
                self._choose(now)

    def to_send(self) -> bytes | None:
        """The request to send now, once."""
        ready, self._ready = self._ready, None
        if ready is None:
            return None
        self._pending = ready
        return ready.octets

    def sent(self, now: int) -> None:
        """What :meth:`to_send` gave leaves now."""
        pending = self._pending
        if pending is None:
            return
        settings = self.settings
        pending.sent_ns = now + line_ns(len(pending.octets), settings.baud)
        self.counts["requests"] += 1
        if pending.telegram.code in {Request.SDN_LOW, Request.SDN_HIGH}:
            self._pending = None
            self._free_ns = pending.sent_ns + bits_ns(SYN_BITS, settings.baud)
            return
        pending.due_ns = now + answered_within_ns(len(pending.octets), settings.baud) + settings.latency_ns

    def receive(self, telegram: Line, now: int) -> None:
        """A telegram of the line; what answers nothing is counted."""
        pending = self._pending
        if pending is None:
            self.counts["unasked"] += 1
            return
        if isinstance(telegram, Telegram):
            asked = pending.telegram
            mine = telegram.destination == self.settings.address and not telegram.is_request
            swapped = (telegram.dsap, telegram.ssap) == (asked.ssap, asked.dsap)
            if not mine or telegram.source != asked.destination or (telegram.data and not swapped):
                # the echo of an adapter, another pair's, or the second answer to a request that was repeated
                self.counts["others"] += 1
                return
        elif not isinstance(telegram, ShortAck):
            self.counts["others"] += 1
            return
        self._pending = None
        self.counts["answers"] += 1
        self._free_ns = now + bits_ns(SYN_BITS, self.settings.baud)
        took = max(0, now - pending.sent_ns)
        self.answer_times[next((i for i, edge in enumerate(ANSWER_EDGES_NS) if took <= edge), -1)] += 1
        if pending.station is not None:
            self._answered(pending.station, pending, telegram, now)
        self.handle_timeout(now)

    def broken(self, count: int) -> None:
        """The line brought telegrams that cannot be read."""
        self.counts["broken"] += count

    # -- choosing requests -------------------------------------------------------------------------------------------

    def _choose(self, now: int) -> None:
        if self._control is not None:
            control, self._control = self._control, None
            telegram = Telegram(
                BROADCAST, self.settings.address, REQUEST | Request.SDN_HIGH, Sap.GLOBAL_CONTROL, Sap.MASTER,
                control.emit(),
            )  # fmt: skip
            self._ready = _Pending(None, telegram, emit_telegram(telegram), acyclic=False, left=0)
            return
        while True:
            if self._queue:
                station = self._queue.popleft()
                if (request := self._request(station, now)) is not None:
                    self._put(station, request, acyclic=False)
                    return
            elif self._again and self._silent is None:
                again = self._ready = self._again.popleft()
                self._silent = again.station
                return
            elif not self._begin_cycle(now) or not (self._queue or self._again):
                return

    def _begin_cycle(self, now: int) -> bool:
        """After a cycle one request for a record; then all slaves that are due, those last that were lost."""
        if not self._acyclic_done:
            self._acyclic_done = True
            if (asked := self._acyclic(now)) is not None:
                self._put(*asked, acyclic=True)
                return False
        if now < self._cycle_ns:
            return False
        if self._began_ns is not None:
            self.cycle_ns = now - self._began_ns
        self._began_ns = now
        self._acyclic_done = False
        self._cycle_ns = max(self._cycle_ns + self.settings.cycle_ns, now)
        self._silent = None
        due = [station for station in self.stations if self._is_due(station, now)]
        self._queue.extend(station for station in due if station.state is not SlaveState.WAITING)
        if not self._again:
            waiting = [station for station in due if station.state is SlaveState.WAITING]
            self._queue.extend(sorted(waiting, key=lambda station: station.due_ns))
        return True

    def _is_due(self, station: Station, now: int) -> bool:
        if station.state is SlaveState.STOPPED or self._is_repeated(station):
            return False
        return station.state is not SlaveState.WAITING or station.due_ns <= now

    def _is_repeated(self, station: Station) -> bool:
        """Whether a request is to be repeated before it gets another one."""
        return any(one.station is station for one in self._again)

    def _acyclic(self, now: int) -> tuple[Station, Telegram] | None:
        count = len(self.stations)
        for step in range(count):
            station = self.stations[(self._next_acyclic + step) % count]
            if station.state in {SlaveState.WAITING, SlaveState.STOPPED}:
                station.connection.lost(station.reason or "the slave does not answer")
                continue
            if station.connection.is_class_one and station.state is not SlaveState.DATA:
                continue
            if self._is_repeated(station):
                continue
            found = station.connection.request(now)
            if found is not None:
                self._next_acyclic = (self._next_acyclic + step + 1) % count
                dsap, ssap, data = found
                return station, self._srd(station, dsap, ssap, data, Request.SRD_LOW)
        return None

    def _put(self, station: Station, telegram: Telegram, *, acyclic: bool) -> None:
        self._ready = _Pending(
            station, telegram, emit_telegram(telegram), acyclic, self.settings.retries,
            releases=self._released and not acyclic,
        )  # fmt: skip

    def _srd(self, station: Station, dsap: int | None, ssap: int | None, data: bytes, how: Request) -> Telegram:
        if station.valid_fcb:
            station.fcb ^= FCB
            function = REQUEST | station.fcb | FCV | how
        else:
            station.fcb, station.valid_fcb = FCB, True
            function = REQUEST | FCB | how
        return Telegram(station.plan.address, self.settings.address, function, dsap, ssap, data)

    def _request(self, station: Station, now: int) -> Telegram | None:
        plan = station.plan
        if self._released and station.state is not SlaveState.STOPPED:
            unlock = Parameters(PrmStatus.UNLOCK_REQ, (1, 1), 0, plan.ident)
            return self._srd(station, Sap.SET_PARAMETERS, Sap.MASTER, unlock.emit(), Request.SRD_HIGH)
        match station.state:
            case SlaveState.WAITING:
                if station.due_ns > now:
                    return None
                station.state = SlaveState.DIAGNOSIS
                return self._diagnose(station)
            case SlaveState.DIAGNOSIS | SlaveState.CHECK:
                return self._diagnose(station)
            case SlaveState.PARAMETERS:
                return self._srd(
                    station, Sap.SET_PARAMETERS, Sap.MASTER, self._parameters(plan).emit(), Request.SRD_HIGH
                )
            case SlaveState.CONFIGURATION:
                return self._srd(station, Sap.CHECK_CONFIGURATION, Sap.MASTER, plan.identifiers, Request.SRD_HIGH)
            case SlaveState.DATA:
                if station.wants_diagnosis:
                    station.wants_diagnosis = False
                    return self._diagnose(station)
                station.polls += 1
                if station.source is not None:
                    station.outputs = station.source()
                return self._srd(station, None, None, station.outputs, Request.SRD_HIGH)
            case _:
                return None

    def _diagnose(self, station: Station) -> Telegram:
        return self._srd(station, Sap.SLAVE_DIAGNOSIS, Sap.MASTER, b"", Request.SRD_HIGH)

    def _parameters(self, plan: SlavePlan) -> Parameters:
        status: int = PrmStatus.LOCK_REQ
        status |= PrmStatus.WD_ON if plan.watchdog_factors else 0
        status |= PrmStatus.FREEZE_REQ if plan.freeze else 0
        status |= PrmStatus.SYNC_REQ if plan.sync else 0
        return Parameters(
            status, plan.watchdog_factors or (0, 0), self.settings.min_tsdr_bits, plan.ident, plan.group, plan.user
        )

    # -- answers -----------------------------------------------------------------------------------------------------

    def _missed(self, pending: _Pending, now: int) -> None:
        """No answer in time: again, with the same FCB, or the slave is lost."""
        self._pending = None
        self._free_ns = now
        station = pending.station
        if station is None:
            return
        # slaves that were lost are tried in the next cycle: this one has taken long enough
        self._queue = deque(one for one in self._queue if one.state is not SlaveState.WAITING)
        if pending.left > 0:
            pending.left -= 1
            station.retries += 1
            self.counts["retries"] += 1
            if pending.acyclic or self._silent is None or self._silent is station:
                self._silent, self._ready = station, pending
            else:
                self._again.append(pending)
            return
        self.counts["unanswered"] += 1
        station.valid_fcb = False
        if pending.acyclic and station.state is SlaveState.DATA:
            station.connection.lost("the slave does not answer")
            return
        self._lose(station, "no answer", now)

    def _answered(self, station: Station, pending: _Pending, telegram: Line, now: int) -> None:
        if pending.acyclic:
            station.connection.answered(telegram)
            return
        if pending.releases or station.state is SlaveState.STOPPED:
            # what was on its way when the release began goes on: the slave is to be released yet
            station.state = SlaveState.STOPPED
            return
        failed = failure(telegram)
        if pending.telegram.dsap == Sap.SLAVE_DIAGNOSIS:
            self._diagnosed(station, telegram, now)
        elif failed is not None and station.state is SlaveState.CONFIGURATION:
            # it took no parameters: the diagnosis says why
            station.state, station.diagnoses = SlaveState.CHECK, 0
        elif failed is not None:
            self._lose(station, f"answered with {failed.name}", now)
        elif station.state is SlaveState.PARAMETERS:
            station.state = SlaveState.CONFIGURATION
        elif station.state is SlaveState.CONFIGURATION:
            station.state, station.diagnoses = SlaveState.CHECK, 0
        elif station.state is SlaveState.DATA:
            self._exchanged(station, telegram, now)

    def _exchanged(self, station: Station, telegram: Line, now: int) -> None:
        data = telegram.data if isinstance(telegram, Telegram) else b""
        tells = isinstance(telegram, Telegram) and telegram.code in {Answer.DH, Answer.RDH}
        if tells and not station.plan.input_octets and len(data) == 1:
            # one octet that means nothing carries the priority (8.3.6)
            data = b""
        if len(data) != station.plan.input_octets:
            self._lose(station, f"{len(data)} octets of inputs instead of {station.plan.input_octets}", now)
            return
        station.answers += 1
        station.inputs, station.answered_ns = data, now
        self._fresh.append(station)
        station.wants_diagnosis |= tells

    def _diagnosed(self, station: Station, telegram: Line, now: int) -> None:
        try:
            diagnosis = Diagnosis.parse(telegram.data if isinstance(telegram, Telegram) else b"")
        except DecodeError as exc:
            self._lose(station, f"a diagnosis that cannot be read: {exc}", now)
            return
        if diagnosis.master not in {NO_MASTER, self.settings.address}:
            # a slave leaves this bit to the master (8.3.1)
            diagnosis = replace(diagnosis, status=diagnosis.status | StationStatus.MASTER_LOCK)
        before, station.diagnosis = station.diagnosis, diagnosis
        status = diagnosis.status
        if station.state is SlaveState.DATA:
            if diagnosis != before:
                # a static one is read in each cycle
                self._events.append(DiagnosisRead(station.plan.name, diagnosis))
            if status & StationStatus.MASTER_LOCK:
                self._lose(station, f"master {diagnosis.master} has it", now)
            elif status & StationStatus.PRM_REQ:
                self._lose(station, "it asks for parameters", now)
            elif status & StationStatus.STAT_DIAG:
                station.wants_diagnosis = True
            return
        if station.state is SlaveState.DIAGNOSIS:
            if diagnosis.ident != station.plan.ident:
                why = f"ident number 0x{diagnosis.ident:04X} instead of 0x{station.plan.ident:04X}"
                self._lose(station, why, now)
            elif status & StationStatus.MASTER_LOCK:
                self._lose(station, f"master {diagnosis.master} has it", now)
            else:
                station.state = SlaveState.PARAMETERS
            return
        for bit, why in _REFUSALS.items():
            if status & bit:
                self._lose(station, why, now)
                return
        if status & StationStatus.STATION_NOT_READY:
            station.diagnoses += 1
            if station.diagnoses >= MOST_DIAGNOSES:
                self._lose(station, "it does not become ready", now)
            return
        station.state = SlaveState.DATA
        station.connects += 1
        station.reason = ""
        self._events.append(ConnectionMade(station.plan.name))
        # slaves that begin in Clear take outputs from now on
        self.control(Control.CLEAR_DATA if self.clear else 0)

    def _lose(self, station: Station, why: str, now: int) -> None:
        exchanged = station.state is SlaveState.DATA
        station.losses += exchanged
        if exchanged or station.reason != why:
            self._events.append(ConnectionMissed(station.plan.name, why, exchanged))
        station.reason = why
        station.inputs = b""
        station.wants_diagnosis = False
        station.valid_fcb = False
        station.connection.lost(why)
        pause = station.plan.reconnect_ns
        stays_lost = pause is None and station.connects
        station.state = SlaveState.STOPPED if self._released or stays_lost else SlaveState.WAITING
        station.due_ns = now + (RETRY_NS if pause is None else pause)


_REFUSALS: Final = {
    StationStatus.PRM_FAULT: "wrong parameters (Prm_Fault)",
    StationStatus.CFG_FAULT: "wrong configuration (Cfg_Fault)",
    StationStatus.NOT_SUPPORTED: "a service that it does not support (Not_Supported)",
    StationStatus.PRM_REQ: "it asks for parameters (Prm_Req)",
    StationStatus.MASTER_LOCK: "another master has it (Master_Lock)",
}
