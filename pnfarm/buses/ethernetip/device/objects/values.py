"""A drive's parameters as CIP has them: each value in its own unit and size (AKD EtherNet/IP manual 8, 12)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.parameters.parameter import ParameterErrorNumber, refusal
from pnfarm.drives.profiles.cip.part import Scaling

if TYPE_CHECKING:
    from pnfarm.drives.parameters.parameter import Parameter
    from pnfarm.drives.parameters.store import ParameterStore
    from pnfarm.drives.profiles.cip.part import CipInstance

__all__ = ["POSITION_UNITS", "PROFILE_UNITS", "CipValues", "wire_number"]

#: Their parameters, by name: the manual gives them no instance.
POSITION_UNITS = "EIP.POSUNIT"
PROFILE_UNITS = "EIP.PROFUNIT"
#: Feedback counts of a revolution, and seconds of a minute.
COUNTS = 1 << 32
MINUTE = 60


class CipValues:
    """Reads and writes parameter instances of one drive; values are integers as on the wire.

    The store has positions in feedback counts, speeds and ramps in thousandths of their unit.  A speed or ramp that was
    written is read back as it was, although the store rounds it.
    """

    def __init__(self, store: ParameterStore) -> None:
        self._store = store
        self._instances = store.model.cip.instances
        #: Instance -> the store's number, the profile unit, and the value that was written.
        self._written: dict[int, tuple[int, int, int]] = {}

    def read(self, number: int) -> int:
        """The value of an instance; raises :class:`ParameterError`.  A command reads as 0."""
        instance = self._instances[number]
        raw = self._store.read(number)[0]
        units = 0
        if instance.scaling is Scaling.POSITION:
            units = self._store.get(POSITION_UNITS)
        elif instance.scaling.profile:
            units = self._store.get(PROFILE_UNITS)
            known, of, written = self._written.get(number, (None, 0, 0))
            if (known, of) == (raw, units):
                return written
        return wire_number(instance, self._store.model.parameters[number], raw, units)

    def write(self, number: int, value: int) -> None:
        """Write an instance; raises :class:`ParameterError`, also for a value that the drive cannot count."""
        instance, parameter = self._instances[number], self._store.model.parameters[number]
        raw, units = value, 0
        if instance.scaling is Scaling.POSITION:
            raw = value * self._store.get(POSITION_UNITS)
        elif instance.scaling.profile:
            units = self._store.get(PROFILE_UNITS)
            raw = round(value * units * MINUTE / COUNTS / parameter.standardisation)
        if not parameter.lowest <= raw <= parameter.highest:
            raise refusal(ParameterErrorNumber.LIMIT_EXCEEDED, parameter, 0)
        self._store.write(number, 0, [raw])
        if instance.scaling.profile:
            self._written[number] = (raw, units, value)

    def named(self, name: str) -> int:
        """The instance of a parameter's name."""
        return self._store.model.resolve(name)[0].pnu


def wire_number(instance: CipInstance, parameter: Parameter, raw: int, units: int) -> int:
    """The store's number as the wire has it; ``units`` are the position or profile units that its scaling needs."""
    value = raw
    if instance.scaling is Scaling.POSITION:
        value = _nearest(raw, units)
    elif instance.scaling.profile:
        value = round(raw * parameter.standardisation * COUNTS / MINUTE / units)
    lowest, highest = _range(instance.size, signed=instance.signed)
    return min(max(value, lowest), highest)


def _nearest(number: int, divisor: int) -> int:
    """The nearest whole quotient, exact for numbers of any size."""
    return (2 * number + divisor) // (2 * divisor)


def _range(size: int, *, signed: bool) -> tuple[int, int]:
    bits = 8 * size
    return (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
