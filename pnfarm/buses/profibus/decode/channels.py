"""Cyclic data of a slave in a capture: only changes give a line, unless every telegram is requested."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses.decoding.channel import SummedChannel, limited
from pnfarm.captures.drive_words import Words, values_text, word_changes, word_of, words_of
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
            channel.words = words_of(signals or ())
            channel.telegram = None if telegram is None else telegram.number
        self._bits = {}
        if described is not None and telegram is not None:
            for name in ("STW1", "ZSW1", "STW2", "ZSW2"):
                if found := described.profidrive.bit_names(name, telegram.number):
                    self._bits[name] = found

    def begin(self) -> None:
        """The slave was parametrised again: its next telegrams are first ones."""
        for channel in (self.outputs, self.inputs):
            channel.begun = False

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
        # the time between two connections is none between two telegrams
        passed = channel.passed(now) if channel.begun else 0
        channel.frames += 1
        channel.last_ns = now
        before, channel.data, channel.octets = channel.data, data, len(data)
        # a slave without outputs, or without inputs, has none of them in each telegram
        begun, channel.begun = channel.begun, True
        if not begun or len(before) != len(data):
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
        yield from limited(self._told, "gap", text, {"seconds": passed / 1e9})

    def _changes(self, channel: Channel, before: bytes, after: bytes) -> Iterator[Description]:
        stw1 = word_of(self.outputs.words, "STW1", self.outputs.data)
        for word, text, details in word_changes(channel.words, self._bits, before, after, stw1):
            yield from limited(self._told, word, text, details)
