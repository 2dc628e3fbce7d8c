"""What only a slave of PROFIBUS can have: another ident number, refusals, diagnoses, another baud rate, noise."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError
from pnfarm.faults.effects.parts import DrivePart, Part
from pnfarm.protocols.profibus.gsd.diagnosis import LINE_BREAK
from pnfarm.protocols.profibus.wire.dp import DpState, join_diagnoses

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.profibus.device.device import ProfibusDevice
    from pnfarm.faults.signals import Report
    from pnfarm.signals.signal import Signal

__all__ = ["SLAVE", "SlavePart"]


class SlavePart(DrivePart):
    """Each setting is put in force by ``put`` and taken back by ``take_back``; the latest of a kind counts.

    Diagnoses count together.
    """

    def __init__(self, device: ProfibusDevice, settle: Callable[[int], None]) -> None:
        self._device = device
        self._settle = settle
        self._ident = device.slave.options.ident
        self._in_force: dict[str, list[Any]] = {
            "ident": [],
            "configuration": [],
            "diagnosis": [],
            "static": [],
            "deaf": [],
        }

    def rebooted(self, now: int) -> None:
        del now
        self._apply()

    def in_force(self) -> list[Any]:
        return [one for values in self._in_force.values() for one in values]

    def put(self, what: str, value: Any, now: int) -> None:
        """``what``: ``ident`` (a number), ``configuration`` (refused), ``diagnosis`` (octets), ``static``, ``deaf``."""
        self._in_force[what].append(value)
        self._apply()
        self._settle(now)

    def take_back(self, what: str, value: Any, now: int) -> None:
        """Undo one :meth:`put`."""
        self._in_force[what].remove(value)
        self._apply()
        self._settle(now)

    def _apply(self) -> None:
        device, known = self._device, self._in_force
        slave, user = device.slave, device.user
        ident = known["ident"][-1] if known["ident"] else self._ident
        if slave.options.ident != ident:
            slave.options.ident = ident
            # a slave cannot change its number in data exchange: it starts again
            slave.leave()
        slave.refuse_configuration = bool(known["configuration"])
        # also before the first Data_Exchange: no Chk_Cfg would come that could be refused
        if known["configuration"] and slave.state is DpState.DATA_EXCH:
            slave.leave()
        diagnosis = join_diagnoses(known["diagnosis"], user.most_further)
        static = bool(known["static"])
        if (user.further_diagnosis, user.static_diagnosis) != (diagnosis, static):
            user.further_diagnosis, user.static_diagnosis = diagnosis, static
            slave.diagnosis_changed()
        device.deaf = bool(known["deaf"])
        if device.deaf:
            slave.search()

    def described_diagnosis(self, name: str, slot: int, channel: int) -> bytes:
        """Blocks of a diagnosis by its name in the device's file; raises :class:`ConfigError`."""
        return self._device.kind.diagnosis(name, slot, channel)

    def wire_break(self, signal: Signal, channel: int) -> Report | None:
        """The error of its channel; None where the device's diagnosis has no room or no number for it."""
        try:
            blocks = self.described_diagnosis(LINE_BREAK, signal.slot, channel)
        except ConfigError:
            return None
        return partial(self.put, "diagnosis", blocks), partial(self.take_back, "diagnosis", blocks)

    @property
    def exchanging(self) -> bool:
        return self._device.slave.exchanging

    @property
    def diagnoses_read(self) -> int:
        """How often a master read the diagnosis."""
        return self._device.counted()["diagnosis"]

    @property
    def refusals(self) -> int:
        """How often the slave reported to a master that something does not fit."""
        return self._device.counted()["refused"]

    @property
    def is_on_line(self) -> bool:
        """Whether it can send."""
        return self._device.station.on_the_wire

    def noise(self, octets: bytes, now: int) -> None:
        """Octets of the slave that are no telegram."""
        self._device.put_on_line(octets)
        self._settle(now)


SLAVE: Part[SlavePart] = Part("slave of PROFIBUS")
