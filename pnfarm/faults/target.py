"""A drive as faults see it: what can be done to it, and what can be watched.

The farm implements this over its stations (:mod:`pnfarm.buses.profinet.faults.connection`); faults know nothing else of a farm.
Every method that changes something has one that undoes it, and both may be called by several faults at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.model_parts import Fault
    from pnfarm.faults.gate import DelayRule, GateRule
    from pnfarm.protocols.profinet.ar import ExpectedKey
    from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
    from pnfarm.protocols.profinet.errors import PnioStatus, RecordError
    from pnfarm.protocols.profinet.events import AlarmConfirmed
    from pnfarm.protocols.profinet.wire.alarms import AlarmItem

__all__ = [
    "NOTHING",
    "Connection",
    "Evidence",
    "FaultTarget",
    "LateRule",
    "ModuleChange",
    "OwnAlarm",
    "ReadyRule",
    "Way",
]

Way = Literal["in", "out"]


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a fault did: occurrences that were possible, those that happened, when (ns, None: never).

    ``confirmed``: it was seen on the wire.
    """

    checks: int = 0
    activations: int = 0
    first_ns: int | None = None
    last_ns: int | None = None
    confirmed: bool = False

    def __add__(self, other: Evidence) -> Evidence:
        firsts = [ns for ns in (self.first_ns, other.first_ns) if ns is not None]
        lasts = [ns for ns in (self.last_ns, other.last_ns) if ns is not None]
        return Evidence(
            self.checks + other.checks,
            self.activations + other.activations,
            min(firsts, default=None),
            max(lasts, default=None),
            self.confirmed or other.confirmed,
        )


NOTHING = Evidence()


@dataclass(frozen=True, slots=True)
class Connection:
    """The drive's cyclic connection.

    ``keys`` are its ARs', never used twice, not even after a reboot; ``established`` once data flows both ways.
    ``watchdog_ns`` is after how long without the drive's data the controller gives up; ``next_ns`` is when the drive's
    next cyclic frame is due.
    """

    keys: frozenset[int]
    established: bool
    cycle_ns: int
    watchdog_ns: int
    next_ns: int


@dataclass(frozen=True, slots=True, eq=False)
class ModuleChange:
    """What stands in a slot instead: nothing (``missing``), or something else; with ``subslot`` of one submodule.

    Without ``telegram`` and ``ident`` it is an ident that the drive does not have.
    """

    slot: int
    subslot: int | None = None
    missing: bool = True
    telegram: int | None = None
    ident: int | None = None
    substitute: bool = False


@dataclass(frozen=True, slots=True)
class OwnAlarm:
    """An alarm that a fault raises about the submodule at ``place``."""

    alarm_type: int
    place: ExpectedKey
    high: bool = False
    items: tuple[AlarmItem, ...] = ()


class ReadyRule(Protocol):
    """Says whether a connection's ApplicationReady is held back."""

    def decide(self) -> tuple[bool, int | None]:
        """(whether this rule acts on the connection at hand, nanoseconds or None for never)."""
        ...


class LateRule(Protocol):
    """Says how late something that the drive has to say leaves."""

    def asked(self, now: int) -> int:
        """Nanoseconds for the one at hand; 0: in time."""
        ...

    def left(self, *, sent: bool) -> None:
        """One that this rule made late has left, or (``sent`` False) never will."""
        ...


class FaultTarget(Protocol):
    """See the module's head."""

    @property
    def name(self) -> str:
        """As the farm file has it."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """That name and the one that DCP gave."""
        ...

    @property
    def models(self) -> tuple[str, ...]:
        """The model's name and aliases."""
        ...

    def connection(self) -> Connection | None:
        """None without a cyclic connection."""
        ...

    def cycles(self) -> int:
        """Cycles that the drive's provider has run since the farm started, over all connections."""
        ...

    def refresh(self, now: int) -> None:
        """The drive may have rebooted since: put everything that is in force into its new machines.

        ``now`` is what hooks are told until the next call.
        """
        ...

    # frames

    def impair(
        self, way: Way, kind: int, *, probability: float, seed: int, count: int, after: int, start_ns: int, stop_ns: int
    ) -> int:
        """Let the engine act on the cyclic frames of one way, as in :mod:`pnfarm.table.impairment`; its number.

        Raises :class:`~pnfarm.errors.ConfigError` when the engine's rows are all in use.
        """
        ...

    def share_limit(self, one: int, other: int) -> None:
        """Let two impairments count against one ``count``."""
        ...

    def set_limit(self, number: int, count: int) -> None:
        """What is left of an impairment's ``count``; 0 or less: nothing."""
        ...

    def impairment(self, number: int) -> Evidence:
        """What it did until now."""
        ...

    def unimpair(self, number: int) -> Evidence:
        """Take it back; what it did."""
        ...

    def gate(self, rule: GateRule) -> None:
        """Let ``rule`` look at every acyclic frame."""
        ...

    def ungate(self, rule: GateRule) -> None:
        """Take it back."""
        ...

    def delay(self, rule: DelayRule) -> None:
        """Let ``rule`` hold back acyclic frames that the drive sends."""
        ...

    def undelay(self, rule: DelayRule) -> None:
        """Take it back; what no other rule holds back leaves at once."""
        ...

    def pull_cable(self) -> None:
        """No carrier until everyone who pulled has plugged."""
        ...

    def plug_cable(self) -> None:
        """Undo one :meth:`pull_cable`."""
        ...

    @property
    def carrier_off(self) -> bool:
        """Whether the link has confirmed that the carrier is off."""
        ...

    # the connection

    def abort(self, code: int, now: int) -> int:
        """End every cyclic AR with an ERR-RTA of this code; how many."""
        ...

    def expire(self, now: int) -> int:
        """End every cyclic AR that hears its controller as if its data hold timer had run out; how many."""
        ...

    def hook_connect(self, hook: Callable[[int], PnioStatus | None]) -> None:
        """Ask ``hook`` about every readable Connect for cyclic data."""
        ...

    def unhook_connect(self, hook: Callable[[int], PnioStatus | None]) -> None:
        """Take it back."""
        ...

    def hold_ready(self, rule: ReadyRule) -> None:
        """Ask ``rule`` about each connection, also the one that is being set up."""
        ...

    def unhold_ready(self, rule: ReadyRule, now: int) -> None:
        """Take it back: connections that wait for nothing else get their ApplicationReady."""
        ...

    def waiting_for_ready(self) -> frozenset[int]:
        """Keys of the ARs that are parametrised and have no ApplicationReady."""
        ...

    # records

    def refuse_records(self, error: RecordError) -> None:
        """Refuse the drive's own records with ``error``; its ``status`` is asked at each refusal.  The latest holds."""
        ...

    def allow_records(self, error: RecordError) -> None:
        """Take it back."""
        ...

    def hold_responses(self, hook: Callable[[int], bool]) -> None:
        """Ask ``hook`` at each read of a pending parameter response whether it is held back."""
        ...

    def let_responses(self, hook: Callable[[int], bool]) -> None:
        """Take it back."""
        ...

    def delay_answers(self, rule: LateRule) -> None:
        """Ask ``rule`` about each answer to a Read or Write; what several rules say adds up."""
        ...

    def answer_in_time(self, rule: LateRule, now: int) -> None:
        """Take it back; when no other rule is left, the answers that are held back leave."""
        ...

    # modules

    def place(self, slot: int | None, subslot: int | None) -> ExpectedKey:
        """A submodule that the drive can have, None: where its set points come in; raises :class:`ConfigError`."""
        ...

    def change_module(self, change: ModuleChange, now: int) -> None:
        """Put ``change`` in force; the latest one holds.  Raises :class:`ConfigError` when the slot cannot have it."""
        ...

    def unchange_module(self, change: ModuleChange, now: int) -> None:
        """Take it back: what the changes in force make of the slot as it was."""
        ...

    def told_at_connect(
        self, slot: int, subslot: int | None, standing: frozenset[int], *, diagnosis: bool = False
    ) -> bool:
        """Whether an AR in DATA, other than those of the keys ``standing``, has a ModuleDiffBlock with the place.

        With ``diagnosis`` it must name a diagnosis of the submodule.
        """
        ...

    # alarms

    def listen(self, hook: Callable[[AlarmConfirmed, int], None]) -> None:
        """Tell ``hook`` of each AlarmAck of a controller's."""
        ...

    def unlisten(self, hook: Callable[[AlarmConfirmed, int], None]) -> None:
        """Take it back."""
        ...

    @property
    def last_alarm(self) -> int:
        """The number of the latest alarm; later ones have greater numbers, until the drive reboots."""
        ...

    def alarm(self, alarm: OwnAlarm, now: int) -> tuple[int, ...] | None:
        """Send it to each AR that owns the place; the alarms' numbers, None when no AR there could be told."""
        ...

    def unalarm(self, alarm: OwnAlarm, now: int) -> None:
        """Undo :meth:`alarm`: who was told that the submodule came or went is told by a plug how it is."""
        ...

    def return_of_submodules(self, last_ns: int, now: int) -> int:
        """Tell that the IOPS of the submodules with data are GOOD again; how many alarms.

        ``last_ns``: the last frame in which they were BAD.  None go to connections that came later, nor while an
        impairment makes them BAD still.
        """
        ...

    def diagnose(self, entry: DiagnosisEntry, now: int) -> None:
        """Let a diagnosis appear; of several with one key the latest holds.  Raises :class:`ConfigError`."""
        ...

    def undiagnose(self, entry: DiagnosisEntry, now: int) -> None:
        """Take it back."""
        ...

    # the drive

    @property
    def powered(self) -> bool:
        """Whether the control supply is on."""
        ...

    def power_off(self, now: int) -> None:
        """Off until everyone who switched off has switched on."""
        ...

    def power_on(self, now: int) -> None:
        """Undo one :meth:`power_off`."""
        ...

    def find_fault(self, wanted: str | int) -> Fault:
        """Number, name or cause in the drive's model; raises :class:`~pnfarm.errors.ConfigError`."""
        ...

    def raise_fault(self, fault: Fault) -> None:
        """Its cause is gone at once; it stands until it is acknowledged."""
        ...

    def hold_fault(self, fault: Fault) -> None:
        """Its cause stays until everyone who held it has released it."""
        ...

    def release_fault(self, fault: Fault) -> None:
        """Undo one :meth:`hold_fault`."""
        ...

    def fault_stands(self, fault: Fault) -> bool:
        """Whether it is active in the drive."""
        ...

    def ignores_fault(self, fault: Fault) -> bool:
        """Whether the drive does not raise it, because a parameter of its own says so."""
        ...

    def fault_count(self, fault: Fault) -> int:
        """How often it has begun a fault situation."""
        ...

    def warn(self, fault: Fault) -> None:
        """Show a warning in front of the others; raises :class:`ConfigError` when there is no room for it."""
        ...

    def unwarn(self, fault: Fault) -> None:
        """Undo one :meth:`warn`."""
        ...

    def warns_of_limit(self, side: str) -> bool:
        """Whether the drive shows a warning on its ``positive`` or ``negative`` limit switch."""
        ...

    def reach_limit(self, side: str) -> None:
        """The axis stands on this limit of its travel, until each caller has called :meth:`leave_limit`."""
        ...

    def leave_limit(self, side: str) -> None:
        """Undo one :meth:`reach_limit`."""
        ...

    def put_load(self, torque: float, inertia: float, friction: float) -> None:
        """Put so much more on the shaft, N m, kg m^2, N m; the loads that are there add up."""
        ...

    def take_load(self, torque: float, inertia: float, friction: float) -> None:
        """Undo one :meth:`put_load` of the same numbers; without any nothing at all is left."""
        ...

    def sent_data(self, since: int) -> bool:
        """Whether a cyclic frame left at or after ``since``."""
        ...

    def lack(self, what: str) -> None:
        """Take ``enable`` or ``supply`` away from the drive, until each caller has called :meth:`regain`."""
        ...

    def regain(self, what: str) -> None:
        """Undo one :meth:`lack`."""
        ...

    def switch_input(self, number: int) -> None:
        """Put a digital input of the drive on, until each caller has called :meth:`release_input`."""
        ...

    def release_input(self, number: int) -> None:
        """Undo one :meth:`switch_input`."""
        ...

    def sent_status(self, bit: int, since: int) -> bool:
        """Whether a cyclic frame that left at or after ``since`` has ``bit`` of ZSW1 set."""
        ...
