"""The connections of one drive: turns the events of context management into rows of the channel tables, the drive's own
fault, and log entries.

* a connected AR opens rows, an ended one closes them;
* a submodule that is plugged, pulled or changes its owner recomputes the rows of its AR;
* an expired data hold timer, reported by the engine, aborts the AR;
* losing an established connection that fed the drive raises a fault of the drive.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from pnfarm.buses.profinet.device import events as happened
from pnfarm.buses.profinet.device import refused
from pnfarm.buses.profinet.device.memory.record_memory import record_words
from pnfarm.protocols.profinet.cm.device.events import (
    AlarmConfirmed,
    ApplicationReadyConfirmed,
    ArAborted,
    ArConnected,
    ArEstablished,
    ArReleased,
    ConnectRefused,
    DiagnosisChanged,
    PrmEndReceived,
    RecordRefused,
    RecordWritten,
    SubmodulesChanged,
)
from pnfarm.protocols.profinet.diagnosis import DiagnosisAppeared, DiagnosisEvent
from pnfarm.station.events import StartUpPhase, WatchdogExpired
from pnfarm.station.lateness import Lateness, budget_ns
from pnfarm.station.visits import Caller

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profinet.device.ar_channels import ArChannels
    from pnfarm.buses.profinet.device.parts import DeviceParts
    from pnfarm.engine.lateness import LatenessRecord
    from pnfarm.protocols.profinet.cm.device.events import CmEvent
    from pnfarm.protocols.profinet.rpc.events import CallMisdirected
    from pnfarm.station.visits import Visits

__all__ = ["StationConnections"]


def _budget(ar: ArChannels) -> int:
    """How late the farm may be on this connection, ns."""
    return budget_ns(ar.cycle_ns, ar.watchdog_ns)


class StationConnections:
    """See the module's docstring.  The counters survive a power cycle."""

    def __init__(self, station: DeviceParts, lateness: LatenessRecord) -> None:
        self._station = station
        self._lateness = lateness
        self.connects = 0
        #: Number of aborted ARs by ErrorCode1 and ErrorCode2 of the ERR-RTA.
        self.aborts: Counter[tuple[int, int]] = Counter()
        self.watchdog_expirations = 0
        #: Those of both that the farm's own lateness caused.
        self.aborts_by_farm: Counter[tuple[int, int]] = Counter()
        self.watchdog_expirations_by_farm = 0
        #: The farm's lateness when a watchdog expired, until its AR has ended, by the AR's key.
        self._expired: dict[int, Lateness] = {}
        #: When a controller last looked for the drive since its last connection, and which time the log has.
        self._sought_ns: int | None = None
        self._told_ns = 0
        self._sought_by_name = False
        #: For injections: how long to hold ApplicationReady back, ns, or None for ever; asked with (AR, sequence, now)
        #: when the parameters are complete.
        self.ready_delay: Callable[[int, int | None, int], int | None] | None = None
        #: Called with (event, now) for each event of context management, after the station has handled it.
        self.listeners: list[Callable[[CmEvent, int], None]] = []
        self._ready_due: list[tuple[int, int, int | None]] = []

    # -- time --------------------------------------------------------------------------------------------------------

    def next_deadline(self) -> int | None:
        """When an ApplicationReady that is held back is due."""
        return min((entry[0] for entry in self._ready_due), default=None)

    def handle_timeout(self, now: int) -> None:
        for entry in [e for e in self._ready_due if e[0] <= now]:
            self._ready_due.remove(entry)
            self._station.cm.application_ready(entry[1], now, entry[2])

    def forget(self) -> None:
        """The supply is off: forget what was held back."""
        self._ready_due.clear()
        self._expired.clear()
        self._not_sought()

    # -- events of context management --------------------------------------------------------------------------------

    def take(self, event: CmEvent, now: int) -> None:
        match event:
            case ArConnected():
                self._connected(event, now)
            case ConnectRefused(ip, status, detail, name, mac):
                caller = Caller(str(ip), mac, name)
                self._visits.refused(caller, [refused.of_connect(status, detail)], attempt=True)
                self._station.note(now, happened.ConnectRefused(ip, status, detail))
            case PrmEndReceived(key, sequence):
                self._station.note(now, StartUpPhase("parameters", key))
                delay = 0 if self.ready_delay is None else self.ready_delay(key, sequence, now)
                if delay is None:
                    self._station.note(now, happened.ApplicationReadyWithheld())
                elif delay == 0:
                    self._station.cm.application_ready(key, now, sequence)
                else:
                    self._ready_due.append((now + delay, key, sequence))
            case SubmodulesChanged():
                self._submodules_changed(event, now)
            case AlarmConfirmed():
                place = event.slot, event.subslot
                self._station.note(now, happened.AlarmAcknowledged(event.alarm_type, *place, event.status))
            case ApplicationReadyConfirmed(key):
                self._station.note(now, StartUpPhase("ready", key))
            case ArEstablished(key):
                ar = self._station.ars.get(key)
                if ar is not None and not ar.established:
                    ar.established = True
                    self.connects += 1
                    self._station.note(now, happened.ArEstablished(ar.initiator, ar.cycle_ns, connection=key))
            case ArAborted(key, code1, code2, reason, by_peer):
                own = self._lateness_of_loss(key, now)
                self._lost(key)
                self.aborts[code1, code2] += 1
                if own is not None and own.late:
                    self.aborts_by_farm[code1, code2] += 1
                aborted = happened.ArAborted(reason, code1, code2, by_peer, lateness=own, connection=key)
                self._station.note(now, aborted)
            case ArReleased(key):
                self.close(key)
                self._station.note(now, happened.ArReleased(connection=key))
            case DiagnosisChanged(change):
                self._diagnosis_changed(change, now)
            case RecordRefused():
                self._record_refused(event)
            case RecordWritten(_, api, slot, subslot, index, data):
                self._record_refused(event)
                self._station.note(now, happened.RecordWritten(len(data), api, slot, subslot, index))
                if index in self._station.description.ignored_records:
                    self._station.note(now, happened.IsochronousIgnored(slot, subslot, index))
                self._station.addressing.record_written(index, data, now)
                if self._station.neighbours.pdev.handles(subslot, index):
                    self._station.keep(now, "pdev", record_words(self._station.neighbours.pdev.written))

    # -- channels ----------------------------------------------------------------------------------------------------

    def _connected(self, event: ArConnected, now: int) -> None:
        if not event.iocrs:
            return
        kind = self._station.kind
        kind.follow_modules()
        ar = self._station.channels.open(event, now)
        self._report_problem(event.ar_key)
        kind.opened(min(ar.cycle_ns for ar in self._station.ars.values() if ar.providers))
        telegram = kind.telegram()
        peer = event.initiator_name, event.initiator_ip
        caller = Caller(str(event.initiator_ip), event.initiator_mac, event.initiator_name)
        self._visits.opened(caller, event.ar_key, ar.cycle_ns, ar.watchdog_ns, now)
        self._compare(caller, event)
        self.begins(now)
        self._station.note(
            now, happened.ArConnected(*peer, telegram, ar.cycle_ns, ar.watchdog_ns, connection=event.ar_key)
        )

    def _compare(self, caller: Caller, event: ArConnected) -> None:
        """What the controller expects, and what is there."""
        ar = self._station.cm.ar(event.ar_key)
        found = [] if ar is None else refused.of_modules(ar, self._station.description, self._station.kind)
        if found:
            self._visits.refused(caller, found, final=False)

    def misdirected(self, call: CallMisdirected) -> None:
        """A Connect for another device was rejected."""
        refusal = refused.of_device(call.object_uuid, self._station.description)
        self._visits.refused(Caller(str(call.peer.ip), call.source_mac or b""), [refusal], attempt=True)

    def _record_refused(self, event: RecordRefused | RecordWritten) -> None:
        """Records of the start-up are compared, not those of a running program."""
        visit = self._visits.of_connection(event.ar_key)
        if visit is None or "data" in visit.steps:
            return
        if (found := refused.of_record(event, self._station.kind)) is not None:
            self._visits.refused(visit.caller, [found], final=False)

    @property
    def _visits(self) -> Visits:
        return self._station.station.visits

    def _diagnosis_changed(self, change: DiagnosisEvent, now: int) -> None:
        """Log a diagnosis as text; a fault also sets the problem indicator in the DataStatus of the frames."""
        entry = change.entry
        for key in self._station.ars:
            self._report_problem(key)
        catalogue = self._station.kind.diagnoses
        words = entry.in_words(None if catalogue is None else catalogue.own_texts)
        appears = isinstance(change, DiagnosisAppeared)
        kind = happened.DiagnosisAppeared if appears else happened.DiagnosisDisappeared
        self._station.note(now, kind(entry, words))

    def _report_problem(self, key: int) -> None:
        """DataStatus: whether one of the AR's submodules has a fault."""
        ar = self._station.cm.ar(key)
        if ar is not None and key in self._station.ars:
            self._station.channels.problem(key, there=self._station.cm.diagnosis.has_fault(ar.owned))

    def _submodules_changed(self, event: SubmodulesChanged, now: int) -> None:
        """The application is ready, or a submodule was pulled, plugged, taken over or released: update GOOD and BAD."""
        key, unusable = event.ar_key, event.unusable
        self._station.kind.follow_modules()
        self._station.channels.relayout(key, unusable, ready=event.starting)
        ar = self._station.ars.get(key)
        if ar is not None:
            self._station.kind.fed(ar)
        # pulling a submodule removed its diagnosis
        self._report_problem(key)
        if event.starting and not unusable:
            return
        self._station.note(now, happened.SubmodulesChanged(frozenset(unusable)))

    def sought(self, now: int, *, by_name: bool) -> None:
        """The drive answered an Identify: for its name, or one to all, which counts as long as no request has the name.

        Many controllers and tools ask again and again; the log has the first one, and the one that counts
        (:meth:`begins`).
        """
        if self._station.ars or (self._sought_by_name and not by_name):
            return
        self._sought_by_name = by_name
        if self._sought_ns is None:
            self._station.note(now, StartUpPhase("identify"))
            self._told_ns = now
        self._sought_ns = now

    def _not_sought(self) -> None:
        self._sought_ns, self._sought_by_name = None, False

    def begins(self, now: int) -> None:
        """The controller goes on, with an address or a Connect: what counts is when it looked for the drive last."""
        if self._sought_ns is not None and self._sought_ns > self._told_ns:
            self._told_ns = self._sought_ns
            self._station.note(min(now, self._told_ns), StartUpPhase("identify"))

    def close(self, key: int) -> None:
        self._not_sought()
        self._station.kind.records.reset(key)
        ar = self._station.channels.close(key)
        if ar is not None:
            self._station.traffic.channels_closed(ar)
            self._station.kind.closed(ar, any_left=self._station.channels.any_cyclic)

    def _lateness_of_loss(self, key: int, now: int) -> Lateness | None:
        """The farm's lateness before this AR ended; None for an AR without IO data.

        The controller's watchdog may have expired by frames that the farm did not send, and its notice may have waited.
        """
        if (told := self._expired.pop(key, None)) is not None:
            return told
        ar = self._station.ars.get(key)
        if ar is None:
            return None
        budget = _budget(ar)
        return self._lateness.between(now - ar.watchdog_ns - 2 * budget, now, budget, by_loop=True)

    def _lost(self, key: int) -> None:
        """An established connection ended without a release: raise the drive's own fault unless it is active."""
        ar = self._station.ars.get(key)
        self.close(key)
        if ar is None:
            return
        # with two controllers on one drive, only the loss of the one that feeds an axis is a fault
        if ar.established:
            self._station.kind.lost(ar)

    # -- the engine's events -----------------------------------------------------------------------------------------

    def first_frame(self, row: int, now: int) -> None:
        """Valid cyclic data arrived on this consumer for the first time."""
        found = self._station.channels.of_consumer(row)
        if found is not None:
            key, cr = found
            self._station.cm.data_received(key, now, cr.iocr_reference)

    def expired(self, row: int, silent_ns: int, now: int, when: int | None = None) -> None:
        """The data hold timer of this consumer ran out, at ``when`` if that is not now."""
        found = self._station.channels.of_consumer(row)
        # those of several CRs may come at once, and the first one ends the AR
        if found is not None and found[0] not in self._expired:
            key = found[0]
            at = now if when is None else when
            ar = self._station.ars[key]
            begin, hold_ns = at - silent_ns, ar.hold_ns
            own = self._lateness.of_silence(begin, at, _budget(ar), hold_ns, ar.cycle_ns, loop_ns=now - at)
            self._expired[key] = own
            self.watchdog_expirations += 1
            self.watchdog_expirations_by_farm += own.late
            self._station.note(at, WatchdogExpired(silent_ns, own, connection=key))
            self._station.cm.watchdog_expired(key, now)
