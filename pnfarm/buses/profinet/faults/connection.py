"""Stations as faults see them, and how a farm gets its fault manager.

Everything here lies around a station, not in it: rows of the engine's impairment table, a gate before the link, the
hooks that its machines offer.  A drive that reboots has new machines; :meth:`StationTarget.refresh` puts the hooks
into them before the next frame is taken.
"""

from __future__ import annotations

import fnmatch
from collections import Counter, deque
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.faults.alarms import CmTarget
from pnfarm.drives import catalogue as drive_catalogue
from pnfarm.drives.axis_handle import CommandRingFullError
from pnfarm.drives.profiles.profidrive.parameter_channel import ParameterChannel
from pnfarm.errors import ConfigError, InternalError
from pnfarm.farm.events import CarrierNotChanged
from pnfarm.faults.carrier import Carriers
from pnfarm.faults.gate import DelayRule, GatedLink, GateRule
from pnfarm.faults.manager import FaultManager
from pnfarm.faults.plan import FaultSpec
from pnfarm.faults.servo import MachineTarget
from pnfarm.faults.target import Connection, Evidence, ReadyRule, Way
from pnfarm.faults.words import FaultError
from pnfarm.firmware.causes import NUMBER_MASK
from pnfarm.protocols.profinet.ar import CmdevState
from pnfarm.protocols.profinet.wire.blocks_connect import ArBlockReq, ArProperties
from pnfarm.table.axis import FAULT_SLOTS, WARNING_SLOTS
from pnfarm.table.axis_codes import (
    CMD_CLEAR_WARNING,
    CMD_HOLD_FAULT,
    CMD_RAISE_FAULT,
    CMD_RAISE_WARNING,
    CMD_RELEASE_FAULT,
)
from pnfarm.table.channel import IDLE
from pnfarm.table.signals import PART_HIGH, WORD_NONE, ZSW1

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.buses.profinet.device.station import DriveStation
    from pnfarm.drives.model_parts import Fault
    from pnfarm.engine.impairments import CyclicEvidence
    from pnfarm.farm.config_expand import DriveConfig
    from pnfarm.farm.config_model import Impairment
    from pnfarm.farm.core import FarmCore
    from pnfarm.links.base import Clock
    from pnfarm.protocols.profinet.binding import DriveRecords
    from pnfarm.protocols.profinet.errors import PnioStatus, RecordError

__all__ = ["StationTarget", "add_impairments", "attach_faults"]


class _HeldChannel(ParameterChannel):
    """A parameter channel whose responses ``asked()`` may hold back."""

    __slots__ = ("_asked", "inner")

    def __init__(self, inner: ParameterChannel, asked: Callable[[], bool]) -> None:
        # the requests stay with the channel around which this one stands
        self.inner = inner
        self._asked = asked

    def pending(self, client: int = 0) -> bool:
        return self.inner.pending(client)

    def reset(self, client: int = 0) -> None:
        self.inner.reset(client)

    def next_deadline(self) -> int | None:
        return self.inner.next_deadline()

    def handle_timeout(self, now: int) -> None:
        self.inner.handle_timeout(now)

    def write_request(self, data: bytes, client: int = 0, now: int = 0) -> bool:
        return self.inner.write_request(data, client, now)

    def read_response(self, maximum: int = 0xFFFF, client: int = 0, now: int = 0) -> bytes | None:
        self.inner.handle_timeout(now)
        if self.inner.pending(client) and self._asked():
            return None
        return self.inner.read_response(maximum, client, now)


class StationTarget(CmTarget, MachineTarget):
    """A :class:`~pnfarm.faults.target.FaultTarget` over one station."""

    def __init__(self, core: FarmCore, station: DriveStation, gate: GatedLink, carriers: Carriers) -> None:
        CmTarget.__init__(self, core, station)
        MachineTarget.__init__(self, station.handle)
        self._gate = gate
        self._carriers = carriers
        self._now = 0
        self._connect_hooks: list[Callable[[int], PnioStatus | None]] = []
        self._ready_rules: list[ReadyRule] = []
        self._record_errors: list[RecordError] = []
        self._response_hooks: list[Callable[[int], bool]] = []
        self._records: DriveRecords = station.parameter_records
        self._off = 0
        self._held: Counter[int] = Counter()
        self._warnings: list[Fault] = []
        self._commands: deque[tuple[int, int]] = deque()

    # who it is

    @property
    def name(self) -> str:
        return self._station.configured_name

    @property
    def names(self) -> tuple[str, ...]:
        return self._station.configured_name, self._station.name

    @property
    def models(self) -> tuple[str, ...]:
        model = self._station.model
        return model.name, *model.aliases

    # what can be watched

    def connection(self) -> Connection | None:
        cyclic = {key: ar for key, ar in self._station.ars.items() if ar.providers}
        if not cyclic:
            return None
        crs = [cr for ar in cyclic.values() for _, cr in ar.providers]
        rows = [self._core.columns.ppm[row] for ar in cyclic.values() for row, _ in ar.providers]
        return Connection(
            keys=frozenset(map(self._unique, cyclic)),
            established=any(ar.established for ar in cyclic.values()),
            cycle_ns=min(cr.cycle_ns for cr in crs),
            # which of the two a controller takes is its own affair; they are equal in practice
            watchdog_ns=max(cr.cycle_ns * max(cr.watchdog_factor, cr.data_hold_factor) for cr in crs),
            next_ns=min((int(row.next_ns) for row in rows if row.state != IDLE), default=0),
        )

    def cycles(self) -> int:
        closed = self._station.channels.closed
        rows = [self._core.columns.ppm[row] for ar in self._station.ars.values() for row, _ in ar.providers]
        return closed.sent + closed.suppressed + sum(int(row.sent) + int(row.suppressed) for row in rows)

    def refresh(self, now: int) -> None:
        self._now = now
        self._flush()
        station = self._station
        if self._connect_hooks or self._ready_rules:
            station.cm.refuse_connect = self._connecting
        if self._records is not station.parameter_records:
            self._gate.forget(station.port.index)
            self._rebooted(now)
            self._put_records()
        # hands may have plugged a submodule that a diagnosis waited for
        self._diagnoses.put()

    # frames

    def impair(
        self, way: Way, kind: int, *, probability: float, seed: int, count: int, after: int, start_ns: int, stop_ns: int
    ) -> int:
        try:
            return self._core.impairments.add(
                self._station.index,
                way,
                kind,
                probability=probability,
                seed=seed,
                count=count,
                after=after,
                start_ns=start_ns,
                stop_ns=stop_ns,
            )
        except InternalError as exc:
            raise ConfigError(f"{self.name} cannot take one more fault on cyclic frames: {exc}; clear some") from exc

    def share_limit(self, one: int, other: int) -> None:
        self._core.impairments.share_limit(one, other)

    def set_limit(self, number: int, count: int) -> None:
        self._core.impairments.set_limit(number, count)

    def impairment(self, number: int) -> Evidence:
        return _evidence(self._core.impairments.evidence(number))

    def unimpair(self, number: int) -> Evidence:
        return _evidence(self._core.impairments.remove(number))

    def gate(self, rule: GateRule) -> None:
        self._gate.add(self._station.port.index, rule)

    def ungate(self, rule: GateRule) -> None:
        self._gate.remove(self._station.port.index, rule)

    def delay(self, rule: DelayRule) -> None:
        self._gate.delay(self._station.port.index, rule)

    def undelay(self, rule: DelayRule) -> None:
        self._gate.undelay(self._station.port.index, rule)

    def pull_cable(self) -> None:
        self._carriers.pull(self._station.port.index, self.name)
        self._station.neighbours.set_link(up=False)

    def plug_cable(self) -> None:
        self._carriers.plug(self._station.port.index, self.name)
        self._station.neighbours.set_link(up=not self._carriers.is_pulled(self._station.port.index))

    @property
    def carrier_off(self) -> bool:
        return self._carriers.is_off(self._station.port.index)

    # the connection

    def abort(self, code: int, now: int) -> int:
        keys = [key for key, ar in self._station.ars.items() if ar.providers]
        for key in keys:
            self._station.cm.abort(key, code, now)
        self._core.settle(self._station, now)
        return sum(key not in self._station.ars for key in keys)

    def hook_connect(self, hook: Callable[[int], PnioStatus | None]) -> None:
        self._connect_hooks.append(hook)
        self._station.cm.refuse_connect = self._connecting

    def unhook_connect(self, hook: Callable[[int], PnioStatus | None]) -> None:
        self._connect_hooks.remove(hook)
        self._unhook_if_idle()

    def _unhook_if_idle(self) -> None:
        if not self._connect_hooks and not self._ready_rules:
            self._station.cm.refuse_connect = None

    def _connecting(self, request: ArBlockReq) -> PnioStatus | None:
        if request.properties & ArProperties.DEVICE_ACCESS:
            return None
        for hook in self._connect_hooks:
            status = hook(self._now)
            if status is not None:
                return status
        self._decide_ready()
        return None

    def hold_ready(self, rule: ReadyRule) -> None:
        self._ready_rules.append(rule)
        self._station.cm.refuse_connect = self._connecting
        if any(not ar.established for ar in self._station.ars.values()):
            self._decide_ready()

    def _decide_ready(self) -> None:
        """For the connection that is being set up; the latest rule that acts on it holds."""
        delay: int | None = 0
        for rule in reversed(self._ready_rules):
            acts, wanted = rule.decide()
            if acts:
                delay = wanted
                break
        self._station.connections.ready_delay_ns = delay

    def unhold_ready(self, rule: ReadyRule, now: int) -> None:
        self._ready_rules.remove(rule)
        self._unhook_if_idle()
        if self._ready_rules:
            self._decide_ready()
            return
        self._station.connections.ready_delay_ns = 0
        for key in self.waiting_for_ready():
            self._station.cm.application_ready(key, now)
        self._core.settle(self._station, now)

    def waiting_for_ready(self) -> frozenset[int]:
        return frozenset(ar.key for ar in self._station.cm.ars if ar.state is CmdevState.W_ARDY)

    # records

    def refuse_records(self, error: RecordError) -> None:
        self._record_errors.append(error)
        self._put_records()

    def allow_records(self, error: RecordError) -> None:
        self._record_errors = [other for other in self._record_errors if other is not error]
        self._put_records()

    def hold_responses(self, hook: Callable[[int], bool]) -> None:
        self._response_hooks.append(hook)
        self._put_records()

    def let_responses(self, hook: Callable[[int], bool]) -> None:
        self._response_hooks.remove(hook)
        self._put_records()

    def _put_records(self) -> None:
        """What is in force on records, into the handler that the drive has now."""
        records = self._records = self._station.parameter_records
        records.error = self._record_errors[-1] if self._record_errors else None
        for index, channel in list(records.channels.items()):
            if self._response_hooks and not isinstance(channel, _HeldChannel):
                records.channels[index] = _HeldChannel(channel, self._holding)
            elif not self._response_hooks and isinstance(channel, _HeldChannel):
                records.channels[index] = channel.inner

    def _holding(self) -> bool:
        # every hook is asked, so that each one's sequence does not depend on the others
        return any([hook(self._now) for hook in self._response_hooks])  # noqa: C419 - see above

    # the drive

    @property
    def powered(self) -> bool:
        return self._station.powered

    def power_off(self, now: int) -> None:
        self._off += 1
        if self._station.powered:
            self._gate.forget(self._station.port.index)
            self._station.power_off(now)
            self._core.settle(self._station, now)

    def power_on(self, now: int) -> None:
        self._off -= 1
        if self._off == 0 and not self._station.powered:
            self._station.power_on(now)
            for fault in self._warnings:
                self._command(CMD_RAISE_WARNING, fault.number)
            self.refresh(now)
            self._core.settle(self._station, now)

    def find_fault(self, wanted: str | int) -> Fault:
        try:
            return self._station.model.fault(wanted)
        except ConfigError as exc:
            raise FaultError([("params.fault", f"{self.name}: {exc}", "")]) from exc

    def raise_fault(self, fault: Fault) -> None:
        self._command(CMD_RAISE_FAULT, fault.code)

    def hold_fault(self, fault: Fault) -> None:
        if fault.number not in self._held and len(self._held) == FAULT_SLOTS:
            raise ConfigError(
                f"{self.name} holds {FAULT_SLOTS} faults already, as many as one situation has; clear one"
            )
        self._held[fault.number] += 1
        if self._held[fault.number] == 1:
            self._command(CMD_HOLD_FAULT, fault.code)

    def release_fault(self, fault: Fault) -> None:
        self._held[fault.number] -= 1
        if self._held[fault.number]:
            return
        del self._held[fault.number]
        try:
            # the drive was off all the while and need not hear of it
            self._commands.remove((CMD_HOLD_FAULT, fault.code))
        except ValueError:
            self._command(CMD_RELEASE_FAULT, fault.number)

    def fault_stands(self, fault: Fault) -> bool:
        return any(int(code) & NUMBER_MASK == fault.number for code in self._station.handle.axis.fault_code)

    def ignores_fault(self, fault: Fault) -> bool:
        return any(int(number) == fault.number for number in self._station.handle.axis.ignored_faults)

    def fault_count(self, fault: Fault) -> int:
        return self._station.fault_counts.get(fault.number, 0)

    def warn(self, fault: Fault) -> None:
        if fault not in self._warnings and len({other.number for other in self._warnings}) == WARNING_SLOTS:
            raise ConfigError(
                f"{self.name} shows {WARNING_SLOTS} warnings already, as many as there is room for; clear one"
            )
        self._warnings.append(fault)
        self._command(CMD_RAISE_WARNING, fault.number)

    def unwarn(self, fault: Fault) -> None:
        self._warnings.remove(fault)
        if fault not in self._warnings:
            self._command(CMD_CLEAR_WARNING, fault.number)

    def warns_of_limit(self, side: str) -> bool:
        return any(fault.cause == f"limit-switch-{side}" for fault in self._station.model.faults.values())

    def _command(self, code: int, argument: int) -> None:
        """To the firmware in this order; what it cannot take now waits for :meth:`refresh`."""
        self._commands.append((code, argument))
        self._flush()

    def _flush(self) -> None:
        # a drive without supply takes nothing, and its ring must have room for the command that boots it
        while self._commands and self._station.powered:
            try:
                self._station.handle.push_command(*self._commands[0])
            except CommandRingFullError:
                return
            self._commands.popleft()

    def sent_data(self, since: int) -> bool:
        columns = self._core.columns
        rows = (columns.ppm[number] for ar in self._station.ars.values() for number, _ in ar.providers)
        return any(int(row.last_ns) >= since for row in rows)

    def sent_status(self, bit: int, since: int) -> bool:
        columns = self._core.columns
        for ar in self._station.ars.values():
            for number, _ in ar.providers:
                row = columns.ppm[number]
                if int(row.last_ns) >= since and _status_word(row, columns.frames[number]) >> bit & 1:
                    return True
        return False


def _status_word(provider: Any, frame: Any) -> int:
    """ZSW1 as it stands in a provider's frame; 0 when the telegram has none."""
    for i in range(int(provider.words)):
        code = int(provider.word_code[i])
        if code != WORD_NONE and code >> 2 == ZSW1 and code & 3 != PART_HIGH:
            place = int(provider.word_offset[i])
            return int(frame[place]) << 8 | int(frame[place + 1])
    return 0


def _evidence(seen: CyclicEvidence) -> Evidence:
    # the engine counts on real frames: an activation is a frame that left changed, or did not leave
    return Evidence(seen.checks, seen.activations, seen.first_ns, seen.last_ns, seen.activations > 0)


# -- the farm ----------------------------------------------------------------------------------------------------------


def attach_faults(core: FarmCore, clock: Clock) -> FaultManager:
    """Give a farm its fault manager, before anything drives the farm.

    The farm's link is wrapped from here on.  ``clock`` is the one by which frames are sent.
    """
    gate = GatedLink(core.link, clock)

    def not_changed(drive: str, reason: str) -> None:
        core.log.record(clock(), drive, CarrierNotChanged(reason))

    carriers = Carriers(core.link, not_changed)
    targets = {s.configured_name: StationTarget(core, s, gate, carriers) for s in core.stations}
    manager = FaultManager(targets, gate)
    gate.set_receiver(core.receive)
    core.link = gate
    core.faults = manager
    return manager


def add_impairments(manager: FaultManager, drives: Sequence[DriveConfig], now: int) -> None:
    """Put the ``impair:`` sections of a farm file in force.

    Raises :class:`ConfigError` that names the group's drives.
    """
    groups: dict[int, list[DriveConfig]] = {}
    for drive in drives:
        groups.setdefault(drive.group, []).append(drive)
    for members in groups.values():
        for index, impairment in enumerate(members[0].impair):
            names = _within(impairment, members)
            where = f"impair[{index}] of drives {members[0].name} to {members[-1].name}"
            if not names:
                raise ConfigError(f"{where}: `on` means none of them; allowed: globs over their names, or leave it out")
            try:
                manager.add(FaultSpec.parse(_plain(impairment, names)), now)
            except ConfigError as exc:
                raise ConfigError(f"{where}: {exc}") from exc


def _within(impairment: Impairment, members: Sequence[DriveConfig]) -> list[str]:
    if impairment.on is None:
        return [drive.name for drive in members]

    def means(glob: str, drive: DriveConfig) -> bool:
        if glob.startswith("model:"):
            model = drive_catalogue.model(drive.model)
            return any(fnmatch.fnmatchcase(name, glob[6:]) for name in (model.name, *model.aliases))
        return glob == "all" or fnmatch.fnmatchcase(drive.name, glob)

    return [drive.name for drive in members if any(means(glob, drive) for glob in impairment.on)]


def _plain(impairment: Impairment, names: list[str]) -> dict[str, Any]:
    """The section as :meth:`FaultSpec.parse` takes it."""
    given = {
        "kind": impairment.kind,
        "on": names,
        "params": dict(impairment.params),
        "probability": impairment.probability,
        "seed": impairment.seed,
        "direction": impairment.direction,
        "after_cycles": impairment.after_cycles,
        "after": _duration(impairment.after_ns),
        "count": impairment.count,
        "for": _duration(impairment.for_ns),
        "cycles": impairment.cycles,
    }
    return {key: value for key, value in given.items() if value is not None}


def _duration(ns: int | None) -> str | None:
    return None if ns is None else f"{ns}ns"
