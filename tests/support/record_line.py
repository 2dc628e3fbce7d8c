"""Records and parameter requests of the built-in controller of a virtual line, over the wire."""

from __future__ import annotations

from parameter_requests import change_request, read_request
from virtual_line import VirtualLine

from pnfarm.drives.profiles.profidrive.base_mode import (
    ParameterAddress,
    ParameterValues,
    emit_request,
    parse_response,
)
from pnfarm.protocols.profinet.cm.controller.events import RecordRead, RecordWriteDone

API = 0x3A00
MANUAL_3_6_2_REQUEST = bytes.fromhex("05020001100103a2000042010002")
MANUAL_3_6_2_RESPONSE = bytes.fromhex("050200010000")


def reading(*wanted: tuple[int, int, int]) -> bytes:
    """A request for (PNU, subindex, number of elements) ..."""
    return emit_request(read_request(7, [ParameterAddress(*one) for one in wanted]))


def changing(pnu: int, form: int, value: int) -> bytes:
    return emit_request(change_request(7, [(ParameterAddress(pnu, 0, 1), ParameterValues(form, (value,)))]))


def access(line: VirtualLine, request: bytes, *, index: int = 47, drive: int = 0) -> bytes | None:
    """One parameter request by a record and its response, over the wire."""
    session = line.plc.sessions[drive]
    assert session.machine is not None
    session.machine.write_record("write", API, 1, 1, index, request)
    session.machine.read_record("read", API, 1, 1, index, 240)
    line.plc.touch(session, line.world.now)
    line.plc.records.clear()
    line.world.run(1.0, until=lambda: len(line.plc.records) == 2)
    (_, written), (_, read) = line.plc.records
    assert isinstance(written, RecordWriteDone)
    assert isinstance(read, RecordRead)
    return read.data


def record(line: VirtualLine, slot: int, subslot: int, index: int, *, api: int = 0) -> RecordRead:
    session = line.plc.sessions[0]
    assert session.machine is not None
    line.plc.records.clear()
    session.machine.read_record("read", api, slot, subslot, index, 4096)
    line.plc.touch(session, line.world.now)
    line.world.run(1.0, until=lambda: bool(line.plc.records))
    ((_, event),) = line.plc.records
    assert isinstance(event, RecordRead)
    return event


def value_of(line: VirtualLine, pnu: int, subindex: int = 0, count: int = 1) -> tuple[int, ...]:
    data = access(line, reading((pnu, subindex, count)))
    assert data is not None
    (entry,) = parse_response(data).entries
    return entry.values
