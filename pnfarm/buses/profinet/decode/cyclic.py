"""Cyclic frames: only changes give a line, unless every frame is requested.

Lines are given for the first frame, bits of STW1 and ZSW1 with the drive's state (PROFIdrive 4.x, general state
machine; bits 8 and 10 of ZSW1 follow the speed and are left out), provider and consumer status, data status, a silence
longer than a given number of cycles, and a wrong step of the cycle counter.  The channel keeps sums for the summary.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.profinet.decode.channels import Channel
from pnfarm.captures.drive_words import control_word, values_text, word_changes
from pnfarm.captures.packet import Description
from pnfarm.protocols.profinet.wire.frame_id import classify_frame_id
from pnfarm.protocols.profinet.wire.rtc import (
    IOXS_BAD_BY_CONTROLLER,
    IOXS_BAD_BY_DEVICE,
    IOXS_BAD_BY_SLOT,
    IOXS_BAD_BY_SUBSLOT,
    STATUS_LENGTH,
    DataStatus,
)
from pnfarm.wire.rtc import SEND_CLOCK_NS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.profinet.decode.shared import Shared
    from pnfarm.captures.packet import Packet

__all__ = ["cyclic", "status_text"]

#: The cycle counter wraps in this time, so that it says nothing after a longer silence.
COUNTER_ROUND_NS = 65_536 * SEND_CLOCK_NS

_STATUS_BITS = (
    (DataStatus.PRIMARY, "primary", "backup"),
    (DataStatus.REDUNDANCY, "redundancy bit set", "redundancy bit clear"),
    (DataStatus.VALID, "data valid", "data invalid"),
    (DataStatus.RUN, "run", "stop"),
    (DataStatus.NO_PROBLEM, "no problem", "station problem"),
    (DataStatus.IGNORE, "to be ignored", "not to be ignored"),
)
_IOXS = {
    IOXS_BAD_BY_SUBSLOT: "bad (subslot)",
    IOXS_BAD_BY_SLOT: "bad (slot)",
    IOXS_BAD_BY_DEVICE: "bad (device)",
    IOXS_BAD_BY_CONTROLLER: "bad (controller)",
}


def status_text(status: int, before: int | None = None) -> str:
    """The data status as text; with ``before`` only the changes."""
    if before is None and status == DataStatus.GOOD:
        return "data good"
    # bits in their normal state are not named
    quiet = 0 if before is not None else ~status & (DataStatus.REDUNDANCY | DataStatus.IGNORE)
    changed = (0xFF if before is None else status ^ before) & ~quiet
    return ", ".join(yes if status & bit else no for bit, yes, no in _STATUS_BITS if changed & bit)


def _ioxs(value: int) -> str:
    return "good" if value & 0x80 else _IOXS.get(value & 0x60, f"0x{value:02X}")


def cyclic(packet: Packet, shared: Shared) -> Iterator[Description]:
    """One cyclic frame; most give no line."""
    payload = packet.payload
    frame_id = payload[0] << 8 | payload[1]
    if len(payload) < 2 + STATUS_LENGTH:
        if shared.capture.every_frame:
            yield Description(f"frame id 0x{frame_id:04X}", classify_frame_id(frame_id).value)
        return
    key = (packet.destination, packet.source, frame_id)
    channel = shared.channels.get(key)
    if channel is None or key in shared.asked:
        channel = shared.channels[key] = _channel(packet, key, channel, shared)
    shared.channels.move_to_end(key)
    template = channel.template
    size = template.layout.data_length if template is not None else len(payload) - 2 - STATUS_LENGTH
    if packet.cut and (template is None or len(payload) < 2 + size + STATUS_LENGTH):
        yield from _cut(channel, packet)
        return
    if len(payload) < 2 + size + STATUS_LENGTH:
        yield from channel.limited("wrong length", f"{len(payload) - 2} octets, {size + STATUS_LENGTH} expected")
        return
    data = payload[2 : 2 + size]
    counter = payload[2 + size] << 8 | payload[3 + size]
    status = payload[4 + size]
    if channel.begun:
        yield from _time(channel, packet.time_ns, counter, shared)
        if status != channel.status:
            yield from channel.limited(
                "DataStatus",
                f"0x{channel.status:02X} -> 0x{status:02X}: {status_text(status, channel.status)}",
                before=channel.status, after=status,
            )  # fmt: skip
        if template is not None and data != channel.data:
            yield from _changes(channel, channel.data, data)
    channel.frames += 1
    first, channel.begun = not channel.begun, True
    channel.source, channel.destination = packet.source, packet.destination
    channel.last_ns, channel.counter, channel.data, channel.status = packet.time_ns, counter, data, status
    if first:
        yield Description("cyclic data begin", _first(channel, size), {"frame_id": frame_id, "octets": size})
    elif shared.capture.every_frame:
        yield Description(
            "cyclic", f"0x{frame_id:04X} counter {counter} {_values(channel)}".rstrip(), {"frame_id": frame_id}
        )


def _cut(channel: Channel, packet: Packet) -> Iterator[Description]:
    """A frame whose counter and status are not in the capture."""
    if not channel.frames:
        lacking = f"{packet.cut} octets of a frame are not in the capture"
        text = f"frame id 0x{channel.frame_id:04X}; only times count, {lacking}"
        yield Description("cyclic data begin", text, {"frame_id": channel.frame_id})
    if channel.last_ns:
        channel.passed(packet.time_ns)
    channel.frames += 1
    channel.source, channel.destination, channel.last_ns = packet.source, packet.destination, packet.time_ns


def _channel(packet: Packet, key: tuple[bytes, bytes, int], before: Channel | None, shared: Shared) -> Channel:
    """That of a Connect without an answer so far, else the one that was there, else one by the farm file."""
    frame_id = key[2]
    asked = shared.asked.get(key)
    if (
        asked is not None
        and asked.template is not None
        and len(packet.payload) >= 2 + asked.template.layout.data_length + STATUS_LENGTH
    ):
        if before is not None and before is not asked:
            asked.inherit(before)
        return asked
    if before is not None:
        return before
    for drive, is_input in ((packet.source, True), (packet.destination, False)):
        template = shared.templates.get((drive, is_input))
        if template is not None and len(packet.payload) >= 2 + template.layout.data_length + STATUS_LENGTH:
            channel = Channel(frame_id, template)
            for (to, source, _), other in shared.channels.items():
                if (to, source) == (packet.source, packet.destination) and other.partner is None:
                    channel.partner, other.partner = other, channel
            return channel
    return Channel(frame_id, None)


def _first(channel: Channel, size: int) -> str:
    parts = [f"frame id 0x{channel.frame_id:04X}", f"{size} octets"]
    template = channel.template
    if template is None:
        return ", ".join([*parts, f"{status_text(channel.status)}; layout unknown, no Connect in the capture"])
    parts.append(f"cycle {channel.cycle_ns / 1e6:g} ms")
    if template.telegram is not None:
        parts.append(f"telegram {template.telegram}")
    return ", ".join([*parts, status_text(channel.status)]) + (f"; {_values(channel)}" if template.axes else "")


def _values(channel: Channel) -> str:
    """The telegram's words of the last frame."""
    template = channel.template
    if template is None:
        return channel.data.hex()
    return "; ".join(
        f"{axis.place}: " * bool(axis.place) + values_text(axis.words, channel.data) for axis in template.axes
    )


def _time(channel: Channel, now: int, counter: int, shared: Shared) -> Iterator[Description]:
    """Interval and cycle counter."""
    passed = channel.passed(now)
    ahead = (counter - channel.counter) & 0xFFFF
    if not channel.step:
        # without a Connect the cycle follows from two equal steps of the counter
        if ahead and ahead == channel.received:
            channel.step, channel.cycle_ns = ahead, ahead * SEND_CLOCK_NS
        channel.received = ahead
        return
    step = channel.step
    late = passed > shared.capture.gap_cycles * channel.cycle_ns
    missing = 0
    whole, rest = divmod(ahead, step)
    if passed < COUNTER_ROUND_NS // 2 and (
        rest or not whole or abs(whole * channel.cycle_ns - passed) > _slack(channel)
    ):
        channel.jumps += 1
        back = ahead > 0x8000
        made = "stays" if not ahead else f"{'-' if back else '+'}{0x10000 - ahead if back else ahead}, +{step} expected"
        yield from channel.limited(
            "cycle counter",
            f"{channel.counter} -> {counter} ({made})",
            before=channel.counter, after=counter, expected_step=step,
        )  # fmt: skip
    elif whole > 1 and passed < COUNTER_ROUND_NS // 2:
        missing = whole - 1
        channel.missing += missing
    if late:
        text = f"a frame ({passed / channel.cycle_ns:.1f} cycles of {channel.cycle_ns / 1e6:g} ms)"
        if missing:
            text += f", {missing} frames missing by the cycle counter"
        text = channel.gap(passed, text, channel.hold_ns)
        yield from channel.limited("gap", text, seconds=passed / 1e9, missing=missing)


def _slack(channel: Channel) -> int:
    """Tolerance between a frame's time and its counter: for a late sender, and the frames of a burst after it."""
    return max(20 * channel.cycle_ns, 100_000_000)


def _changes(channel: Channel, before: bytes, after: bytes) -> Iterator[Description]:
    template = channel.template
    if template is None:
        return
    partner = channel.partner
    for axis in template.axes:
        stw1 = None
        if partner is not None and partner.template is not None:
            words = next((one.words for one in partner.template.axes if one.place == axis.place), ())
            stw1 = control_word(words, partner.data)
        for word, text, details in word_changes(axis.words, axis.bits, before, after, stw1):
            yield from channel.limited(f"{word} of {axis.place}" if axis.place else word, text, **details)
    changed: dict[tuple[str, int, int], list[str]] = {}
    for kind, slot, subslot, offset in template.statuses:
        if before[offset] != after[offset]:
            changed.setdefault((kind, before[offset], after[offset]), []).append(f"{slot}/0x{subslot:04X}")
    for (kind, old, new), places in changed.items():
        every = len(places) == sum(1 for status in template.statuses if status[0] == kind)
        of = "all" if every else f"slot/subslot {', '.join(places)}"
        yield from channel.limited(kind, f"of {of} {_ioxs(old)} -> {_ioxs(new)}", before=old, after=new)
