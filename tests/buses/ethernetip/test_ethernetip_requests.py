"""Explicit requests of the built-in scanner, by unconnected messages."""

from __future__ import annotations

from scanner_line import ScannerLine
from wire_tap import WireTap

from pnfarm.buses.ethernetip.controller.requests import MOST_WAITING

IDLE = "{kind: idle}"
#: Class of the Parameter object and the attribute with the value; instances of the AKD's table.
PARAMETER, VALUE = 0x0F, 1


def connected(**options) -> ScannerLine:
    line = ScannerLine(program=IDLE, **options)
    line.connect()
    return line


def instance_of(line: ScannerLine, parameter: str):
    model = line.station().model
    return model.cip.instances[model.resolve(parameter)[0].pnu]


def answered(line: ScannerLine, request, within: float = 1.0):
    assert line.world.run(within, until=lambda: request.done)
    return request


def test_attributes_are_read_and_written():
    line = connected()
    vendor = answered(line, line.plc.get_attribute("axis-1", 1, 1, 1, line.world.now))
    assert (vendor.ok, vendor.data, vendor.error) == (True, (452).to_bytes(2, "little"), "")
    mode = answered(line, line.plc.set_attribute("axis-1", 0x25, 1, 3, b"\1", line.world.now))
    assert mode.ok
    assert line.station().store.get("DRV.OPMODE") == 1
    assert line.row()["requests_answered"] == 2


def test_parameters_are_read_and_written_by_their_instances():
    line = connected()
    home, mode = (instance_of(line, name) for name in ("HOME.P", "DRV.OPMODE"))
    data = (-5).to_bytes(home.size, "little", signed=True)
    written = answered(line, line.plc.set_attribute("axis-1", PARAMETER, home.number, VALUE, data, line.world.now))
    assert written.ok, written.error
    read = answered(line, line.plc.get_attribute("axis-1", PARAMETER, home.number, VALUE, line.world.now))
    assert read.data == data
    read = answered(line, line.plc.get_attribute("axis-1", PARAMETER, mode.number, VALUE, line.world.now))
    assert read.data[0] == line.station().store.get("DRV.OPMODE")


def test_a_refusal_has_its_status_in_words():
    line = connected()
    request = answered(line, line.plc.get_attribute("axis-1", 0x99, 1, 1, line.world.now))
    assert not request.ok
    assert request.error == "object does not exist"
    mode = instance_of(line, "DRV.OPMODE").number
    refused = answered(line, line.plc.set_attribute("axis-1", PARAMETER, mode, VALUE, b"\x09", line.world.now))
    assert "invalid attribute value" in refused.error


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
    home = instance_of(line, "HOME.P").number
    request = line.plc.get_attribute("axis-1", PARAMETER, home, VALUE, line.world.now)
    line.run(0.7)
    assert not request.done
    assert answered(line, request).ok
