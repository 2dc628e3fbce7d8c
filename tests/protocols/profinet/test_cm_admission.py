"""Which Connect ends an older AR: its own initiator's, from where that one's came, and in order itself."""

from __future__ import annotations

from dataclasses import replace
from ipaddress import IPv4Address

import pytest
from cm_support import CONTROLLER_MAC, PEER, UUID_1, UUID_2, Bench, Plan

from pnfarm.protocols.profinet.cm.device.events import ArAborted, ConnectRefused
from pnfarm.protocols.profinet.errors import ErrorCode, RtaError, pnio_error
from pnfarm.protocols.profinet.rpc.fragments import Peer

P = Plan()
ELSEWHERE = Peer(IPv4Address("192.168.0.66"), PEER.port)
STRANGER = bytes.fromhex("020000000066")
#: What a station that read the controller's Connect on the wire can say of itself.
COPY = {"ar": replace(P.ar, ar_uuid=UUID_2)}
OUT_OF_AR_RESOURCES = (0x40, 4)
STATE_CONFLICT = (0x3D, 0)


def connect(bench: Bench, peer: Peer = PEER, mac: bytes = CONTROLLER_MAC, **changes: object):
    payload = replace(P, **changes).payload()
    bench.cm.receive_call("call", 0, payload, 4096, peer, bench.now, source_mac=mac)
    ((_, status, _),) = bench.cm.responses()
    return status


def established() -> Bench:
    bench = Bench()
    assert connect(bench).ok
    key = bench.key()
    assert bench.prm_end()[0].ok
    assert bench.cm.application_ready(key, bench.now)
    bench.cm.data_received(key, bench.now)
    (call,) = bench.cm.calls()
    bench.confirm(call)
    bench.events()
    return bench


FOREIGN = {
    "another address": {"peer": ELSEWHERE},
    "another station": {"mac": STRANGER},
    "another MAC address in the request": {"ar": replace(P.ar, ar_uuid=UUID_2, initiator_mac=STRANGER)},
    "its own place altogether": {
        "peer": ELSEWHERE,
        "mac": STRANGER,
        "ar": replace(P.ar, ar_uuid=UUID_2, initiator_mac=STRANGER),
    },
}


@pytest.mark.parametrize("place", FOREIGN)
def test_the_name_and_the_object_uuid_of_a_controller_end_nothing_from_elsewhere(place: str) -> None:
    bench = established()
    status = connect(bench, **{**COPY, **FOREIGN[place]})
    assert (status.error_code1, status.error_code2) == OUT_OF_AR_RESOURCES
    (refused,) = bench.events()
    assert isinstance(refused, ConnectRefused)
    assert [ar.uuid for ar in bench.cm.ars] == [UUID_1]


@pytest.mark.parametrize("place", FOREIGN)
def test_the_uuid_of_a_standing_ar_ends_nothing_from_elsewhere(place: str) -> None:
    bench = established()
    changes = dict(FOREIGN[place])
    if "ar" in changes:
        changes["ar"] = replace(changes["ar"], ar_uuid=UUID_1)
    status = connect(bench, **changes)
    assert (status.error_code1, status.error_code2) == STATE_CONFLICT
    assert [ar.uuid for ar in bench.cm.ars] == [UUID_1]
    assert not [event for event in bench.events() if isinstance(event, ArAborted)]


def test_a_controller_that_restarted_gets_in_at_once() -> None:
    bench = established()
    assert connect(bench, **COPY).ok
    aborted = next(event for event in bench.seen + bench.events() if isinstance(event, ArAborted))
    assert aborted.error_code2 == RtaError.RE_RUN_ABORTS_EXISTING
    assert [ar.uuid for ar in bench.cm.ars] == [UUID_2]


def test_a_controller_that_runs_its_start_up_again_ends_its_ar_and_gets_in_with_the_next_try() -> None:
    bench = established()
    status = connect(bench)
    assert (status.error_code1, status.error_code2) == STATE_CONFLICT
    assert bench.cm.ars == ()
    assert connect(bench).ok


_IDENTIFIER, _DATA = P.drive.submodules
#: Of the submodule with the telegram, whose 12 octets are not 10.
SHORTER = replace(_DATA, data=tuple(replace(one, data_length=10) for one in _DATA.data))


@pytest.mark.parametrize("uuid", [UUID_1, UUID_2])
@pytest.mark.parametrize(
    "broken",
    [
        {"alarm": replace(P.alarm, rta_retries=99)},
        {"drive": replace(P.drive, submodules=(_IDENTIFIER, SHORTER))},
    ],
    ids=["alarm CR", "length of a submodule's data"],
)
def test_a_connect_that_is_not_in_order_ends_nothing(uuid: object, broken: dict[str, object]) -> None:
    bench = established()
    status = connect(bench, ar=replace(P.ar, ar_uuid=uuid), **broken)
    assert not status.ok
    assert [ar.uuid for ar in bench.cm.ars] == [UUID_1]
    assert not [event for event in bench.events() if isinstance(event, ArAborted)]


def test_a_connect_that_the_farm_refuses_on_purpose_ends_nothing() -> None:
    bench = established()
    bench.cm.refuse_connect = lambda _: pnio_error(ErrorCode.CONNECT, 0x40, 4)
    connect(bench, **COPY)
    assert [ar.uuid for ar in bench.cm.ars] == [UUID_1]


def test_a_connect_finds_no_channels_while_those_of_ended_ars_are_not_free() -> None:
    bench = established()
    bench.cm.has_room = lambda: False
    status = connect(bench, **COPY)
    assert (status.error_code1, status.error_code2) == (0x40, 7)
    bench.cm.has_room = lambda: True
    assert connect(bench, **COPY).ok
