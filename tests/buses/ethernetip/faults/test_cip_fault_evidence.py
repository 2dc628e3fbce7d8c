"""The evidence of every kind on EtherNet/IP: confirmed when it happened, told why not when something prevented it."""

from __future__ import annotations

from typing import Any

import pytest
from cip_line import CipLine, io_path
from kinds_of import kinds_of

from pnfarm.faults.kind import InjectionKind
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.epath import ElectronicKey, emit_epath, logical_path
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.wire.endpoint import StreamEnd

PARAMS: dict[str, dict[str, Any]] = {
    "drive-fault": {"fault": 702},
    "drive-warning": {"warning": 107},
    "digital-input": {"input": 0},
    # slower than the drive's packets
    "throttle": {"rate": 10},
}
#: What has to happen for the fault to have something to act on: a new connection, an object that is read.
RECONNECTS = frozenset({"connect-refuse", "forward-open-delay", "identity-change", "rpc-delay", "rpc-silence"})
READS = frozenset({"record-error", "record-delay", "encapsulation-error", "session-drop"})
#: Nothing that leaves a drive can show these.
UNSEEN = frozenset({"drive-warning"})
#: Of these, something is seen also without an originator, or of a drive without supply: the cable, the listener.
ALWAYS_SEEN = frozenset({"link-down", "link-flap", "mac-change", "power-cycle", "tcp-refuse"})
EVERY_KIND = pytest.mark.parametrize("kind", kinds_of("ethernetip"), ids=lambda kind: kind.name)


def read(line: CipLine) -> None:
    scanner = line.scanners[0]
    pnu = line.farm.axes[0].model.resolve("DRV.OPMODE")[0].pnu
    path = logical_path(0x0F, pnu, 1)
    scanner.originator.request(message_request(Service.GET_ATTRIBUTE_SINGLE, path), line.world.now)
    scanner.pump()


@EVERY_KIND
def test_every_kind_in_force_is_confirmed_by_what_the_farm_sees_on_the_wire(kind: InjectionKind) -> None:
    line = CipLine()
    scanner = line.scanners[0]
    asked = scanner.asked
    scanner.asked = lambda: asked(path=emit_epath([ElectronicKey(452, 16, 1, 1, 13)]) + io_path())
    line.connect()
    line.enable()
    fault = line.add(kind.name, params=PARAMS.get(kind.name, {}))
    if kind.name == "fault-not-acknowledging":
        line.add("f702")
    if kind.name in READS:
        read(line)
    if kind.name in RECONNECTS:
        line.add("ar-abort")
    line.run(5.0 if kind.name in RECONNECTS else 1.0)
    seen = fault.evidence()
    if kind.name in UNSEEN:
        assert (seen.confirmation, seen.activations) == ("inconclusive", 1)
        return
    assert (seen.confirmation, seen.reason) == ("confirmed", "")
    assert seen.checks >= seen.activations >= 1
    assert seen.first_ns <= seen.last_ns <= line.world.now


@pytest.mark.parametrize("prevented_by", ["no originator", "no supply"])
@EVERY_KIND
def test_what_cannot_show_is_inconclusive_and_says_why(kind: InjectionKind, prevented_by: str) -> None:
    line = CipLine()
    station = line.farm.axes[0]
    line.scanners[0].until = 1 << 62
    if prevented_by == "no supply":
        station.station.power_off(line.world.now)
        line.farm.settle(station.station, line.world.now)
    line.run(0.1)
    fault = line.add(kind.name, params=PARAMS.get(kind.name, {}))
    line.run(1.0)
    seen = fault.evidence()
    if kind.name in ALWAYS_SEEN and seen.confirmed:
        assert seen.activations
        return
    assert seen.confirmation == "inconclusive"
    if seen.activations:
        assert seen.reason == "it happened, and nothing that left the drive since could show it"
    elif seen.checks:
        assert seen.reason == f"it could have happened {seen.checks} times, and did not"
    else:
        assert seen.reason == "there was nothing yet that it could act on"


def test_a_stream_that_its_peer_closed_takes_what_waited_for_it_along() -> None:
    line = CipLine()
    line.connect()
    line.add("rpc-delay", params={"delay": "10s"})
    read(line)
    line.run(0.1)
    scanner = line.scanners[0]
    held = [item for items in line.faults.drive("axis-01").in_force().values() for item in items]
    scanner.link.sockets.act(scanner.port.index, StreamEnd(scanner.stream))
    scanner.stream = None
    line.run(0.1)
    left = [item for items in line.faults.drive("axis-01").in_force().values() for item in items]
    assert len(left) < len(held)
    line.clear()
    assert line.faults.drive("axis-01").in_force() == {}
