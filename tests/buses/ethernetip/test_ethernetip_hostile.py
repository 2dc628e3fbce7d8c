"""What devices answer may be anything: the scanner bears it, and connects once the answers are right again."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scanner_line import ScannerLine

from pnfarm.protocols.enip.wire.encapsulation import EncapsulationPdu, emit_encapsulation
from pnfarm.wire.endpoint import StreamReceived

IDLE = "{kind: idle}"


class Between(ScannerLine):
    """``change(number, octets)`` gives what the scanner hears instead of the drive's octets; None: as they are."""

    def __init__(self, **options) -> None:
        super().__init__(program=IDLE, start=False, **options)
        self.change = None
        self.count = 0
        self.plc.link.sockets.set_user(self.hear)

    def hear(self, event, now) -> None:
        if isinstance(event, StreamReceived) and self.change is not None:
            self.count += 1
            event = replace(event, data=self.change(self.count, event.data))
        self.plc.socket_event(event, now)

    def recovers(self) -> None:
        self.change = None
        assert self.world.run(20.0, until=lambda: self.plc.all_connected), self.reasons()
        assert len(self.world.switch.network.ends) <= 4


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(st.tuples(st.integers(0, 200), st.integers(1, 255)), min_size=1, max_size=6), st.booleans())
def test_changed_octets_of_answers_do_no_harm(flips, multicast):
    line = Between(more=f"\n  request_timeout: 200ms\n  multicast: {str(multicast).lower()}")

    def change(number: int, data: bytes) -> bytes:
        octets = bytearray(data)
        for place, mask in flips:
            if octets:
                octets[(place + number) % len(octets)] ^= mask
        return bytes(octets)

    line.change = change
    line.plc.start(line.world.now)
    line.run(2.0)
    line.recovers()


@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(st.binary(max_size=80), min_size=1, max_size=5))
def test_any_octets_instead_of_answers_do_no_harm(pieces):
    line = Between(more="\n  request_timeout: 200ms")
    line.change = lambda number, _: pieces[number % len(pieces)]
    line.plc.start(line.world.now)
    line.run(2.0)
    line.recovers()


@pytest.mark.parametrize("command", [0x63, 0x65, 0x66, 0x6F, 0x70, 0x72, 0xFFFF])
def test_messages_that_nobody_asked_for_do_no_harm(command):
    line = Between()
    line.plc.start(line.world.now)
    line.connect()
    (stream,) = line.plc.life.by_stream
    for size in (0, 4, 30, 600):
        message = emit_encapsulation(EncapsulationPdu(command, bytes(size), 1))
        line.plc.socket_event(StreamReceived(line.plc.port.index, stream, message), line.world.now)
        line.run(0.02)
    line.run(1.0)
    assert line.row()["losses"] == 0
    assert line.row()["state"] == "DATA"


def interval(data: bytes, value: int) -> bytes:
    """The answer to Forward_Open with another interval from target to originator."""
    return data.replace(
        (10_000).to_bytes(4, "little") * 2, (10_000).to_bytes(4, "little") + value.to_bytes(4, "little")
    )


@pytest.mark.parametrize("value", [0, 99, 0xFFFFFFFF])
def test_an_interval_that_cannot_be_is_not_taken(value):
    line = Between()
    line.change = lambda _, data: interval(data, value)
    line.plc.start(line.world.now)
    line.run(0.5)
    assert line.row()["last_reason"] == f"Forward_Open: the device answers with a packet interval of {value} us"
    assert line.plc.sessions[0].consumer is None
    line.recovers()
    assert "old connection closed" in line.texts()


def test_a_longer_interval_of_the_device_is_taken():
    line = Between()
    line.change = lambda _, data: interval(data, 30_000)
    line.plc.start(line.world.now)
    line.connect()
    assert int(line.plc.columns.cpm[line.plc.sessions[0].consumer].hold_ns) == 16 * 30_000_000


def test_a_multicast_without_a_group_is_not_taken():
    line = Between(more="\n  multicast: true")
    line.change = lambda _, data: data.replace(bytes([239, 192]), bytes([10, 77]))
    line.plc.start(line.world.now)
    line.run(0.5)
    assert line.row()["last_reason"] == "Forward_Open: the device names no group to which it sends"
    line.recovers()
