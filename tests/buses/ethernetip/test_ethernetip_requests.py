"""Explicit requests of the built-in scanner, by unconnected messages and over class 3."""

from __future__ import annotations

import pytest
from scanner_line import ScannerLine
from wire_tap import WireTap

from pnfarm.buses.ethernetip.controller.requests import MOST_WAITING
from pnfarm.errors import ConfigError

IDLE = "{kind: idle}"
BOTH = pytest.mark.parametrize("explicit", ["unconnected", "connected"])


def connected(explicit: str = "unconnected", more: str = "", **options) -> ScannerLine:
    line = ScannerLine(program=IDLE, more=f"\n  explicit: {explicit}{more}", **options)
    line.connect()
    return line


def answered(line: ScannerLine, request, within: float = 1.0):
    assert line.world.run(within, until=lambda: request.done)
    return request


@BOTH
def test_attributes_are_read_and_written(explicit):
    line = connected(explicit)
    vendor = answered(line, line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now))
    assert (vendor.ok, vendor.data, vendor.error) == (True, (452).to_bytes(2, "little"), "")
    mode = answered(line, line.plc.set_attribute("axis-1", 0x25, 1, 3, b"\1", line.world.now))
    assert mode.ok
    assert line.station().store.get("DRV.OPMODE") == 1
    assert line.row()["requests_answered"] == 2


@BOTH
def test_parameters_are_read_and_written_by_name_and_by_instance(explicit):
    line = connected(explicit)
    written = answered(line, line.plc.write_parameter("axis-1", "HOME.P", -5, line.world.now))
    assert written.ok, written.error
    read = answered(line, line.plc.read_parameter("axis-1", "HOME.P", line.world.now))
    assert line.plc.parameter_value("axis-1", "HOME.P", read) == -5
    mode = answered(line, line.plc.read_parameter("axis-1", 136, line.world.now))
    assert line.plc.parameter_value("axis-1", 136, mode) == line.station().store.get("DRV.OPMODE")


@BOTH
def test_a_refusal_has_its_status_in_words(explicit):
    line = connected(explicit)
    request = answered(line, line.plc.get_attribute("axis-1", 0x99, 1, 1, line.world.now))
    assert not request.ok
    assert request.error == "object does not exist"
    with pytest.raises(ConfigError, match="object does not exist"):
        line.plc.parameter_value("axis-1", "HOME.P", request)
    refused = answered(line, line.plc.write_parameter("axis-1", "DRV.OPMODE", 9, line.world.now))
    assert "invalid attribute value" in refused.error


def test_class_3_is_opened_with_the_first_request_and_again_after_it_was_lost():
    line = ScannerLine(program=IDLE, more="\n  explicit: connected", start=False)
    tap = WireTap(line.plc)
    line.plc.start(line.world.now)
    line.connect()
    tap.said.clear()
    for _ in range(2):
        answered(line, line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now))
    assert tap.said == [
        "FORWARD_OPEN 20062401",
        "connected GET_ATTRIBUTE_SINGLE 200124013001",
        "connected GET_ATTRIBUTE_SINGLE 200124013001",
    ]
    manager = line.station().device.adapter.manager
    explicit = next(one for one in manager.connections.values() if one.explicit)
    manager.close(explicit.number, line.world.now)
    lost = answered(line, line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now), within=6.0)
    assert lost.error == "no reply in time"
    again = answered(line, line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now))
    assert again.ok
    assert line.row()["losses"] == 0


def test_one_request_is_under_way_at_a_time_and_they_are_answered_in_order():
    line = ScannerLine(program=IDLE, start=False)
    tap = WireTap(line.plc)
    line.plc.start(line.world.now)
    line.connect()
    tap.said.clear()
    requests = [line.plc.get_attribute("axis-1", 1, 1, n, line.world.now) for n in range(1, 8)]
    assert len(tap.said) == 1
    answered(line, requests[-1])
    assert all(request.ok for request in requests)
    assert [text[-2:] for text in tap.said] == [f"{n:02x}" for n in range(1, 8)]


def test_requests_are_bounded_and_end_with_their_session():
    line = connected()
    requests = [line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now) for _ in range(MOST_WAITING + 3)]
    assert [request.error for request in requests[-2:]] == ["too many requests are waiting"] * 2
    assert not requests[0].done
    line.plc.release(line.world.now)
    line.run(1.0)
    assert all(request.done for request in requests)
    late = line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now)
    assert (late.done, late.error) == (True, "there is no session")


def test_a_request_without_an_answer_fails_in_time_and_the_next_one_goes_on():
    line = connected(more="\n  request_timeout: 500ms")
    encapsulation = line.station().device.adapter.encapsulation
    heard, encapsulation.received = encapsulation.received, lambda *_: None
    first = line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now)
    line.run(0.4)
    assert not first.done
    line.run(0.2)
    assert first.error == "no reply in time"
    encapsulation.received = heard
    assert answered(line, line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now)).ok
    assert line.row()["losses"] == 0


def test_a_drive_that_thinks_long_is_awaited():
    line = connected(group=", realism: {parameter_latency: 800ms}")
    request = line.plc.read_parameter("axis-1", "HOME.P", line.world.now)
    line.run(0.7)
    assert not request.done
    assert answered(line, request).ok


def test_what_cannot_be_asked_is_an_error_of_the_user():
    line = connected()
    now = line.world.now
    for ask, words in (
        (lambda: line.plc.read_parameter("axis-1", "NO.SUCH", now), "no parameter"),
        (lambda: line.plc.read_parameter("other", "HOME.P", now), "no drive"),
        (lambda: line.plc.write_parameter("axis-1", "DRV.OPMODE", 300, now), "1 octets"),
    ):
        with pytest.raises(ConfigError, match=words):
            ask()
