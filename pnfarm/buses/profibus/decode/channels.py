"""Cyclic data of a slave in a capture: only changes give a line, unless every telegram is requested."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses.decoding.channel import SummedChannel, limited
from pnfarm.captures.drive_words import SECOND_MASK, Words, bits_text, stw1_text, values_text, words_of, zsw1_text
from pnfarm.captures.packet import Description

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.captures.conversations import CyclicChannel
    from pnfarm.captures.packet import Capture
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.telegrams.telegram import Telegram

__all__ = ["Channel", "Cyclic"]


@dataclass(slots=True, eq=False)
class Channel(SummedChannel):
    """One direction; ``cycle_ns`` is the mean time between two telegrams."""

    words: Words = ()
    telegram: int | None = None
    octets: int = 0
    #: Time of the slave's watchdog, where the capture has its Set_Prm.
    hold_ns: int = 0

    def word(self, name: str, data: bytes | None = None) -> int | None:
        """A word of the last telegram, or of ``data``."""
        octets = self.data if data is None else data
        place = next((offset for known, offset, _ in self.words if known == name), None)
        return None if place is None or len(octets) < place + 2 else int.from_bytes(octets[place : place + 2], "big")

    @property
    def cycle_ns(self) -> int:
        return self.total_ns // self.interval_count if self.interval_count else 0

    def summary(self) -> CyclicChannel:
        """For the summary of the capture."""
        return self.figures(f"{self.octets} octets", self.telegram, self.cycle_ns)


class Cyclic:
    """Outputs and inputs of one slave."""

    def __init__(self, master: bytes, slave: bytes, capture: Capture) -> None:
        self.outputs = Channel(source=master, destination=slave)
        self.inputs = Channel(source=slave, destination=master)
        self._capture = capture
        self._told: dict[str, int] = {}
        self._bits: dict[str, tuple[str, ...]] = {}

    def lay_out(self, described: Model | None, telegram: Telegram | None) -> None:
        """Names of the words, from now on."""
        for channel, signals in (
            (self.outputs, telegram and telegram.output),
            (self.inputs, telegram and telegram.input),
        ):
            channel.words = words_of(one.name if one is not None else "" for one in signals or ())
            channel.telegram = None if telegram is None else telegram.number
        self._bits = {}
        if described is not None and telegram is not None:
            for name in ("STW1", "ZSW1", "STW2", "ZSW2"):
                if found := described.profidrive.bit_names(name, telegram.number):
                    self._bits[name] = found

    def begin(self) -> None:
        """The slave was parametrised anew: its next telegrams are first ones."""
        for channel in (self.outputs, self.inputs):
            channel.data = b""

    def channels(self) -> Iterator[CyclicChannel]:
        """Those with telegrams."""
        for channel in (self.outputs, self.inputs):
            if channel.frames:
                yield channel.summary()

    def sent(self, data: bytes, now: int) -> Iterator[Description]:
        """Outputs of the master."""
        yield from self._take(self.outputs, data, now)

    def answered(self, data: bytes, now: int) -> Iterator[Description]:
        """Inputs of the slave."""
        yield from self._take(self.inputs, data, now)

    def _take(self, channel: Channel, data: bytes, now: int) -> Iterator[Description]:
        mean = channel.cycle_ns
        passed = channel.passed(now) if channel.frames else 0
        channel.frames += 1
        channel.last_ns = now
        before, channel.data, channel.octets = channel.data, data, len(data)
        if not before or len(before) != len(data):
            yield self._first(channel)
            return
        if mean and channel.interval_count > 2 and passed > self._capture.gap_cycles * mean:
            yield from self._gap(channel, passed, mean)
        if before != data:
            yield from self._changes(channel, before, data)
        if self._capture.every_frame:
            yield Description("Data_Exchange", values_text(channel.words, data) or data.hex(" "))

    @staticmethod
    def _first(channel: Channel) -> Description:
        named = f"telegram {channel.telegram}, " if channel.telegram is not None else ""
        values = values_text(channel.words, channel.data) or channel.data.hex(" ")
        return Description(
            "cyclic data begin", f"{named}{len(channel.data)} octets; {values}", {"octets": len(channel.data)}
        )

    def _gap(self, channel: Channel, passed: int, mean: int) -> Iterator[Description]:
        text = f"a telegram ({passed / mean:.1f} times the mean, {mean / 1e6:.3g} ms)"
        text = channel.gap(passed, text, channel.hold_ns)
        yield from limited(self._told, "gap", text, seconds=passed / 1e9)

    def _changes(self, channel: Channel, before: bytes, after: bytes) -> Iterator[Description]:
        for name in ("STW1", "ZSW1", "STW2", "ZSW2"):
            old, new = channel.word(name, before), channel.word(name, after)
            if old is None or new is None or old == new:
                continue
            usual = self._bits.get(name)
            if name == "STW1":
                text = stw1_text(old, new, usual) if usual else stw1_text(old, new)
            elif name == "ZSW1":
                stw1 = self.outputs.word("STW1")
                text = zsw1_text(old, new, stw1, usual) if usual else zsw1_text(old, new, stw1)
            else:
                text = bits_text(old, new, usual or (), SECOND_MASK)
            if text:
                yield from limited(self._told, name, f"0x{old:04X} -> 0x{new:04X}: {text}", before=old, after=new)
