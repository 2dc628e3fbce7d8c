"""A drive's wire, as injections see it: its cyclic frames, its acyclic ones, its cable."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError, InternalError
from pnfarm.faults.effects.evidence import Evidence
from pnfarm.faults.effects.parts import DrivePart, Part

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.engine.channels.impairments import CyclicEvidence, ImpairmentTable
    from pnfarm.faults.effects.carrier import Carriers
    from pnfarm.faults.effects.effect import Window
    from pnfarm.faults.gate.gate import DelayRule, GatedLink, GateRule, Listener
    from pnfarm.faults.gate.socket_gate import SocketGate
    from pnfarm.wire.direction import Direction

__all__ = ["AGREED_LENGTH", "MESSAGES", "WIRE", "Impairing", "Wire"]


@dataclass(frozen=True, slots=True)
class Impairing:
    """Which cyclic frames are hit.  ``count`` 0: no limit; ``settings`` are fields of the row, by the kind."""

    probability: float
    seed: int
    count: int
    window: Window
    settings: Mapping[str, float]


@dataclass(eq=False)
class Wire(DrivePart):
    """``station`` is the drive's row of the table, ``port`` its port of the link.

    ``carrier_changed(up)`` notifies the drive.  ``classes`` are those of its acyclic frames, None where they are not
    known, ``messages`` those that open its connections and reach its parameters.  ``sockets`` is the gate of a drive
    with streams and datagrams; what holds for acyclic frames holds for them.
    """

    _drive: str
    _station: int
    _port: int
    _impairments: ImpairmentTable
    _gate: GatedLink
    _carriers: Carriers
    _carrier_changed: Callable[[bool], None]
    _: KW_ONLY
    classes: frozenset[str] | None = None
    messages: frozenset[str] = frozenset()
    sockets: SocketGate | None = None

    def rebooted(self, now: int) -> None:
        del now
        self.forget()

    def forget(self) -> None:
        """The drive lost its supply: drop what is held back."""
        self._gate.forget(self._port)
        if self.sockets is not None:
            self.sockets.forget(self._port)

    def in_force(self) -> list[Any]:
        pulled = ["cable"] if self._carriers.is_pulled(self._port) else []
        sockets = [] if self.sockets is None else self.sockets.in_force(self._port)
        return [*self._impairments.of_station(self._station), *self._gate.in_force(self._port), *sockets, *pulled]

    # cyclic frames

    def impair(self, direction: Direction, kind: int, how: Impairing) -> int:
        """Let the engine act on the cyclic frames of one direction, as in :mod:`pnfarm.table.impairment`; its number.

        Raises :class:`~pnfarm.errors.ConfigError` when the engine's rows are all in use.
        """
        try:
            return self._impairments.add(
                self._station,
                direction,
                kind,
                probability=how.probability,
                seed=how.seed,
                count=how.count,
                after=how.window.after,
                start_ns=how.window.start_ns,
                stop_ns=how.window.stop_ns,
                settings=how.settings,
            )
        except InternalError as exc:
            raise ConfigError(
                f"{self._drive} cannot take one more injection into cyclic frames: {exc}; clear some"
            ) from exc

    def share_limit(self, one: int, other: int) -> None:
        """Let two impairments count against one ``count``."""
        self._impairments.share_limit(one, other)

    def set_limit(self, number: int, count: int) -> None:
        """Occurrences left of an impairment's ``count``; 0 or less: none."""
        self._impairments.set_limit(number, count)

    def waiting(self, number: int) -> int:
        """Frames that an impairment holds at present."""
        return self._impairments.waiting(number)

    def impairment(self, number: int) -> Evidence:
        """Its evidence so far."""
        return _evidence(self._impairments.evidence(number))

    def unimpair(self, number: int) -> Evidence:
        """Remove it; returns its evidence."""
        return _evidence(self._impairments.remove(number))

    # acyclic frames

    def gate(self, rule: GateRule) -> None:
        """Apply ``rule`` to every acyclic frame."""
        self._gate.add(self._port, rule)
        if self.sockets is not None:
            self.sockets.add(self._port, rule)

    def ungate(self, rule: GateRule) -> None:
        """Remove it."""
        self._gate.remove(self._port, rule)
        if self.sockets is not None:
            self.sockets.remove(self._port, rule)

    def delay(self, rule: DelayRule) -> None:
        """Let ``rule`` hold back acyclic frames that the drive sends."""
        self._gate.delay(self._port, rule)
        if self.sockets is not None:
            self.sockets.delay(self._port, rule)

    def undelay(self, rule: DelayRule) -> None:
        """Remove it; frames that no other rule holds back leave at once."""
        self._gate.undelay(self._port, rule)
        if self.sockets is not None:
            self.sockets.undelay(self._port, rule)

    # a second station at the drive's port

    def listen(self, listener: Listener) -> None:
        """Let ``listener`` hear every acyclic frame that the drive sends or gets."""
        self._gate.listen(self._port, listener)

    def unlisten(self, listener: Listener) -> None:
        """Remove it."""
        self._gate.unlisten(self._port, listener)

    def send_beside(self, frame: bytes) -> None:
        """Send a frame of another station at the drive's port."""
        self._gate.send_beside(self._port, frame)

    def deliver(self, frame: bytes, now: int) -> None:
        """Hand the drive a frame of such a station."""
        self._gate.deliver(self._port, frame, now)

    # the cable

    def pull_cable(self) -> None:
        """No carrier until every caller that pulled has plugged."""
        self._carriers.pull(self._port, self._drive)
        self._carrier_changed(False)

    def plug_cable(self) -> None:
        """Undo one :meth:`pull_cable`."""
        self._carriers.plug(self._port, self._drive)
        self._carrier_changed(not self._carriers.is_pulled(self._port))

    @property
    def carrier_off(self) -> bool:
        """Whether the link has confirmed that the carrier is off."""
        return self._carriers.is_off(self._port)


def _evidence(seen: CyclicEvidence) -> Evidence:
    # the engine counts on real frames: an activation is a frame that left changed, or did not leave
    return Evidence(seen.checks, seen.activations, seen.first_ns, seen.last_ns, seen.activations > 0)


WIRE: Part[Wire] = Part("wire")
#: A wire whose ``messages`` open connections and reach parameters, beside the cyclic frames.
MESSAGES: Part[Wire] = Part("acyclic messages")
#: A wire whose cyclic frames have data of a length that was agreed.
AGREED_LENGTH: Part[Wire] = Part("cyclic frames of an agreed length")
