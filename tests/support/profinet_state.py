"""The state of a PROFINET drive and of its controller that tests of injections compare; ``line`` is a ``FaultLine``."""

from __future__ import annotations

from pnfarm.drives.profiles.profidrive.base_mode import ParameterAddress, ParameterRequest, emit_request
from pnfarm.protocols.profinet.description import SlotState
from pnfarm.protocols.profinet.errors import describe_status

CYCLE = 0.016
API = 0x3A00


def station(line):
    return line.farm.axes[0]


def alarms(line) -> list[str]:
    """The controller's log lines of alarms."""
    return [entry.data["detail"] for entry in line.plc_log.entries("axis-01") if entry.event == "alarm"]


def iops(line) -> int:
    """Of the telegram, in the drive's next frame."""
    line.run(3 * CYCLE)
    (ar,) = station(line).device.ars.values()
    ((row, cr),) = ar.providers
    return line.farm.channels.provided(row)[cr.data_of(1, 2).iops_offset]


def at_rest(line) -> bool:
    """Nothing of any fault is left in the drive, in its machines or at its gate."""
    s, gate = station(line), line.farm.link
    device = s.device
    slots = [device.cm.plugged.state(slot) for slot in device.description.slots]
    return (
        slots == [SlotState(device.description.default_module(slot)) for slot in device.description.slots]
        and not len(device.cm.diagnosis)
        and device.rpc.late is None
        and not device.connections.listeners
        and not gate.in_force(s.port.index)
        and gate.next_deadline() is None
        and not line.faults.drive(s.configured_name).in_force()
        and line.rows_free()
    )


def read(line) -> str:
    """Ask the drive for a parameter; how its record access ended."""
    station = line.farm.axes[0]
    (index, *_) = station.device.kind.records.channels
    slot, subslot = (
        station.device.description.modules[0].slot,
        station.device.description.modules[0].submodules[0].subslot,
    )
    request = emit_request(ParameterRequest(1, 1, 1, (ParameterAddress(922),)))
    session = line.session()
    line.plc.records.clear()
    session.machine.write_record("w", API, slot, subslot, index, request)
    session.machine.read_record("r", API, slot, subslot, index, 240)
    line.plc.touch(session, line.world.now)
    assert line.until(lambda: len(line.plc.records) == 2, 2.0)
    written, answer = (event for _, event in line.plc.records)
    bad = next((event.status for event in (written, answer) if event.status and not event.status.ok), None)
    if bad is None:
        assert answer.data
        return "answered"
    return next(
        words for words in ("module failure", "state conflict", "resource busy") if words in describe_status(bad)
    )
