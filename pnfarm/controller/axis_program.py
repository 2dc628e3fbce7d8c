"""A PLC program of one's own: the class that a file named by ``program: {python: FILE}`` derives from.

::

    from pnfarm import AxisProgram


    class MyProgram(AxisProgram):
        def cycle(self, inputs, outputs, now):
            outputs.stw1 = 0x047F if inputs.zsw1.ready_to_switch_on else 0x0476
            outputs.velocity = 60.0

There is one object for each axis.  ``cycle`` is called once in each cycle of its axis, after the telegram was sent;
what it writes is sent with the next one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.controller.program_record import MOST_OPEN, ProgramRecord
from pnfarm.vocabulary.quoting import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.controller.line_device import LineDevice
    from pnfarm.drives.telegrams.signal_view import Inputs, Outputs

__all__ = ["AxisProgram", "Line"]


class Line:
    """All axes of the controller: ``line["axis-02"].inputs``, ``for axis in line``; ``line.device("island-1").inputs``.

    ``devices``: those of the farm without axes, by name.
    """

    def __init__(self, devices: Mapping[str, LineDevice] | None = None) -> None:
        self._axes: dict[str, AxisProgram] = {}
        self._devices = devices or {}
        #: The devices that a program has asked for.
        self._used: dict[str, LineDevice] = {}

    def add(self, axis: AxisProgram) -> None:
        """Called by the controller, when it makes the program."""
        self._axes[axis.name] = axis

    def device(self, name: str) -> LineDevice:
        """A device of the farm file's ``devices:``; raises :class:`KeyError`."""
        found = self._used.get(name)
        if found is None:
            if name not in self._devices:
                raise KeyError(f"the controller has no device {name!r}{did_you_mean(name, self._devices)}")
            found = self._used[name] = self._devices[name]
            found.take()
        return found

    def take(self) -> None:
        """Called by the controller, before the programs: what the devices sent."""
        for device in list(self._used.values()):
            device.take()

    def give(self) -> None:
        """Called by the controller, after the programs: what they wrote is sent."""
        for device in list(self._used.values()):
            device.give()

    def __getitem__(self, name: str) -> AxisProgram:
        if name not in self._axes:
            raise KeyError(f"the controller has no axis {name!r}{did_you_mean(name, self._axes)}")
        return self._axes[name]

    def __iter__(self) -> Iterator[AxisProgram]:
        return iter(self._axes.values())

    def __len__(self) -> int:
        return len(self._axes)

    def __contains__(self, name: object) -> bool:
        return name in self._axes


class AxisProgram:
    """Base class; see the module's docstring.  ``__init__`` takes no argument and may use the attributes below."""

    #: Whether the controller counts the sign of life (STW2, bits 12 to 15) with each call of ``cycle``.
    counts_sign_of_life = True

    #: The axis' name, as the farm has it, and the drive's model.
    name: str = ""
    model: str = ""
    #: All axes of the controller, this one too.
    line: Line
    #: Its accesses to records that are not done, and those that the controller has yet to begin.
    open_records: list[ProgramRecord]
    asked_records: list[ProgramRecord]
    #: As ``cycle`` gets them.
    inputs: Inputs
    outputs: Outputs
    #: Of the controller's clock, ns: when ``cycle`` was called first, and last.
    began_ns: int = 0
    now_ns: int = 0
    #: Duration of a cycle, ns.
    cycle_ns: int = 0

    def cycle(self, inputs: Inputs, outputs: Outputs, now: int) -> None:
        """One cycle; ``now`` is the controller's clock in ns.  Values in ``outputs`` stay until they are changed."""
        raise NotImplementedError

    def read_record(self, index: int) -> ProgramRecord:
        """Read a record of the drive; the answer is in what is returned, once that is ``done``.

        Raises :class:`ValueError` for what cannot be asked, and for one access too many.
        """
        return self._ask(ProgramRecord(index, None))

    def write_record(self, index: int, data: bytes) -> ProgramRecord:
        """Write a record of the drive, as :meth:`read_record`."""
        return self._ask(ProgramRecord(index, data))

    def _ask(self, record: ProgramRecord) -> ProgramRecord:
        self.open_records[:] = [one for one in self.open_records if not one.done]
        if len(self.open_records) >= MOST_OPEN:
            raise ValueError(f"{MOST_OPEN} accesses to records are not done; one more is refused")
        self.open_records.append(record)
        self.asked_records.append(record)
        return record

    @property
    def connected(self) -> bool:
        """Whether the drive exchanges data with the controller."""
        return self.inputs.valid

    @property
    def seconds(self) -> float:
        """Since the first call of ``cycle``."""
        return (self.now_ns - self.began_ns) / 1e9
