"""A drive on a virtual line whose control word a test writes itself, word by word, as a PLC's program does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from virtual_line import VirtualLine

from pnfarm.table.signals import ACTUAL_SLOTS, SETPOINT_SLOTS

READY = 0x0476
ON = 0x0477


class MsdHand(VirtualLine):
    """``send`` signals by name over the wire, ``see`` what the controller receives; ``connect`` comes first."""

    def __init__(self, model: str = "moog-msd", cycle: str = "1ms", **options: Any) -> None:
        super().__init__(model=model, cycle=cycle, **options)
        self.faults = self.farm.injections
        self.connect()
        self.plc.columns.program[0].active = 0
        self.plc.columns.image[0].sent[:] = 0
        # the drive boots
        self.run(0.2)

    def fault(self, kind: str, **fields: Any) -> Any:
        return self.faults.inject({"kind": kind, "on": "all", **fields}, self.world.now)

    def clear(self, fault: Any) -> None:
        self.faults.clear(fault.id, self.world.now)

    def send(self, seconds: float = 0.004, **signals: int) -> int:
        """Set points by name; ZSW1 after so many seconds."""
        for name, value in signals.items():
            self.plc.columns.image[0].sent[SETPOINT_SLOTS[name]] = value
        self.run(seconds)
        return self.see("ZSW1") & 0xFFFF

    def see(self, name: str) -> int:
        return int(self.plc.columns.image[0].received[ACTUAL_SLOTS[name]])

    def until(self, condition: Any, within: float = 5.0) -> None:
        assert self.world.run(within, until=condition), f"ZSW1 0x{self.see('ZSW1') & 0xFFFF:04X}"

    def enable(self, last: int = 0x047F, **signals: int) -> None:  # type: ignore[override]
        for word in (READY, ON, last):
            self.send(STW1=word, **signals)
        assert self.see("ZSW1") & 0x0007 == 0x0007, f"ZSW1 0x{self.see('ZSW1') & 0xFFFF:04X}"

    def map(self, output: list[int], actual: list[int]) -> None:
        """Map P-0915 and P-0916, and the same words in the controller's own program."""
        (session,) = self.plc.sessions
        head = self.store.parameter_words
        for pnu, numbers in ((915, output), (916, actual)):
            self.store.write(pnu, 0, numbers + [0] * (len(self.store.output_words()) - head - len(numbers)))
        session.plan = replace(
            session.plan, output_words=self.store.output_words(), input_words=self.store.input_words()
        )
        self.plc.channels.relayout(session, ())
        self.farm.settle(self.farm.axes[0].station, self.world.now)
        self.run(0.01)

    @property
    def store(self) -> Any:
        return self.farm.axes[0].store

    @property
    def axis(self) -> Any:
        return self.farm.axes[0].handle.axis

    @property
    def labels(self) -> list[str]:
        """The drive's active faults."""
        known = self.farm.axes[0].model.faults
        return [known[int(code) & 0xFFFFFF].label for code in self.axis.faults.code if code]
