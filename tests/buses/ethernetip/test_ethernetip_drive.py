"""A drive on EtherNet/IP as its peers see it, in memory and virtual time."""

from __future__ import annotations

import re
from ipaddress import IPv4Address

import pytest
from peer import DRIVES, Rig, io_path

from pnfarm.buses.ethernetip.device.answers import MOST_HELD
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.protocols.enip.originator_events import (
    ConnectionEnded,
    ConnectionMade,
    ConnectionNotMade,
    RequestAnswered,
)
from pnfarm.protocols.enip.status import ConnectionStatus, GeneralStatus, Service
from pnfarm.protocols.enip.wire.epath import ElectronicKey, emit_epath, logical_path
from pnfarm.protocols.enip.wire.forward_open import ConnectionType, NetworkParameters, TransportClass
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.wire.endpoint import Datagram, DatagramReceived

ENABLE, LOAD, HARD_STOP = 0x80, 0x01, 0x20
IDENTITY, PARAMETER, SUPERVISOR, CONTROLLER = 0x01, 0x0F, 0x24, 0x25
INPUT_ONLY, LISTEN_ONLY = 254, 255
HEARTBEAT = {"o_size": 2, "path": io_path(INPUT_ONLY)}
LISTENER = {"o_size": 2, "path": io_path(LISTEN_ONLY), "multicast": True}


@pytest.fixture
def rig():
    return Rig()


def opened(rig: Rig, **changes: object) -> ConnectionMade:
    """One peer's session and connection."""
    rig.peer.connect()
    made = rig.peer.open(**changes)
    assert isinstance(made, ConnectionMade), made
    return made


def refusal(made: object) -> tuple[int, ...]:
    assert isinstance(made, ConnectionNotMade), made
    assert made.reply.status == GeneralStatus.CONNECTION_FAILURE
    return made.reply.extended


def enabled(rig: Rig) -> None:
    opened(rig)
    rig.peer.command(bytes([ENABLE]))
    rig.peer.run(0.5)
    assert rig.peer.response[0] & 0x80


# -- cyclic data -------------------------------------------------------------------------------------------------------


def test_an_owner_enables_the_drive_and_reads_its_state(rig):
    enabled(rig)
    device = rig.station().device
    assert device.connected
    assert device.connects == 1
    assert "connection established" in rig.texts()
    view = device.connection()
    assert (view.state, view.ip, view.cycle_ns, view.watchdog_ns) == (
        "Established",
        IPv4Address("10.77.1.100"),
        10_000_000,
        40_000_000,
    )


def test_data_are_produced_at_the_agreed_interval_without_drift(rig):
    opened(rig)
    rig.peer.run(0.1)
    before = rig.peer.received(1)
    rig.peer.run(10.0)
    assert rig.peer.received(1) - before == 1000


def test_an_interval_below_the_products_is_lengthened_and_told(rig):
    made = opened(rig, t_to_o_rpi_us=2000)
    assert made.reply.t_to_o_api_us == 10_000
    rig.peer.run(1.0)
    assert 98 <= rig.peer.received(1) <= 102


def test_the_interval_of_production_is_whole_ticks_of_the_drive_and_told(rig):
    made = opened(rig, t_to_o_rpi_us=25_000)
    assert (made.reply.o_to_t_api_us, made.reply.t_to_o_api_us) == (10_000, 30_000)
    rig.peer.run(0.1)
    before = rig.peer.received(1)
    rig.peer.run(3.0)
    assert rig.peer.received(1) - before == 100


@pytest.mark.parametrize("interval", [2000, 25_000])
def test_with_lax_limits_the_interval_is_as_asked(interval):
    rig = Rig(DRIVES.replace("model:", "limits: lax, model:"))
    made = opened(rig, t_to_o_rpi_us=interval)
    assert made.reply.t_to_o_api_us == interval


def test_silence_beyond_the_timeout_raises_f702_and_ends_the_session(rig):
    enabled(rig)
    rig.peer.silence(1)
    rig.peer.run(0.035)
    assert rig.station().fault_counts == {}
    rig.peer.run(0.02)
    station = rig.station()
    assert station.fault_counts == {702: 1}
    assert dict(station.device.losses()) == {"timed-out": 1}
    assert station.device.watchdog_expirations == 1
    assert not station.device.connected
    assert rig.peer.closed, "the drive closes the TCP connection, too"
    assert "watchdog expired" in rig.texts()


def test_the_timeout_multiplier_is_that_of_the_request(rig):
    opened(rig, timeout_multiplier=3)  # 32 intervals
    rig.peer.run(0.1)
    rig.peer.silence(1)
    rig.peer.run(0.3)
    assert rig.station().device.connected
    rig.peer.run(0.05)
    assert not rig.station().device.connected


def test_a_connection_without_any_data_ends_after_ten_seconds_and_raises_no_fault(rig):
    opened(rig)
    rig.peer.silence(1)
    rig.peer.run(9.9)
    assert len(rig.station().device.channels.open) == 1
    rig.peer.run(0.2)
    station = rig.station()
    assert not station.device.channels.open
    assert dict(station.device.losses()) == {"no-data": 1}
    assert station.fault_counts == {}


def test_idle_of_the_originator_takes_the_set_points_and_raises_no_loss(rig):
    enabled(rig)
    rig.peer.mode(1, run=False)
    rig.peer.run(0.5)
    station = rig.station()
    assert not rig.peer.response[0] & 0x80
    assert station.device.connected
    assert 702 not in station.fault_counts
    assert "controller in stop" in rig.texts()
    rig.peer.mode(1, run=True)
    rig.peer.run(0.1)
    assert "controller in run" in rig.texts()


def test_forward_close_ends_the_connection_without_a_fault(rig):
    enabled(rig)
    assert isinstance(rig.peer.close(1), ConnectionEnded)
    station = rig.station()
    assert not station.device.channels.open
    assert station.fault_counts == {}
    assert not station.device.losses()
    assert "connection released" in rig.texts()


def test_the_loss_of_tcp_leaves_the_cyclic_connection_alone(rig):
    enabled(rig)
    rig.peer.originator.unregister(rig.world.now)
    rig.peer.pump()
    rig.peer.run(1.0)
    assert rig.station().device.connected
    assert rig.peer.response[0] & 0x80


def test_a_new_owner_after_a_loss_is_exchanging_again_and_clears_the_fault_by_command(rig):
    enabled(rig)
    rig.peer.silence(1)
    rig.peer.run(0.2)
    rig.peer.connect()
    assert isinstance(rig.peer.open(), ConnectionMade)
    rig.peer.command(b"")
    rig.peer.run(0.1)
    assert rig.peer.response[0] & 0x08, "general fault"
    clear = rig.station().model.resolve("DRV.CLRFAULTS")[0].pnu
    assert rig.peer.set(PARAMETER, clear, 1, b"\1").status == 0
    rig.peer.run(0.1)
    assert not rig.peer.response[0] & 0x08
    rig.peer.command(bytes([ENABLE]))
    rig.peer.run(0.2)
    assert rig.peer.response[0] & 0x80
    assert rig.station().device.connects == 2


# -- more than one connection ------------------------------------------------------------------------------------------


def test_a_second_owner_is_refused_and_the_first_one_keeps_the_drive():
    rig = Rig(peers=2)
    enabled(rig)
    rig.peers[1].connect()
    assert refusal(rig.peers[1].open())[0] == ConnectionStatus.OWNERSHIP_CONFLICT
    assert rig.peer.response[0] & 0x80
    assert "connection refused" in rig.texts()


def test_originators_that_only_listen_get_the_same_data_and_have_no_say():
    rig = Rig(peers=2)
    enabled(rig)
    other = rig.peers[1]
    other.connect()
    assert isinstance(other.open(**HEARTBEAT), ConnectionMade)
    other.run(0.2)
    assert other.response == rig.peer.response
    other.silence(1)
    other.run(0.2)
    station = rig.station()
    assert rig.peer.response[0] & 0x80
    assert station.fault_counts == {}
    assert dict(station.device.losses()) == {"timed-out": 1}


def test_the_identity_object_s_status_knows_connections_without_an_owner(rig):
    def extended():
        return int.from_bytes(rig.peer.get(1, 1, 5).data, "little") >> 4 & 0xF

    rig.peer.connect()
    assert extended() == 3, "no I/O connection"
    rig.peer.open(**HEARTBEAT)
    assert extended() == 7, "a connection without run mode"
    rig.peer.open()
    rig.peer.run(0.1)
    assert extended() == 6, "one in run mode"


def test_multicast_is_one_stream_for_all_its_listeners():
    rig = Rig(peers=3)
    rig.peer.connect()
    assert isinstance(rig.peer.open(multicast=True), ConnectionMade)
    rig.peers[1].connect()
    made = rig.peers[1].open(**LISTENER)
    assert isinstance(made, ConnectionMade), made
    rig.peers[2].connect()
    assert isinstance(rig.peers[2].open(**LISTENER), ConnectionMade)
    rig.peer.run(1.0)
    assert len([one for one in rig.station().device.channels.open.values() if one.provider is not None]) == 1
    assert all(95 <= peer.received(1) <= 102 for peer in rig.peers)
    assert {item.address for item in made.items if not item.o_to_t} == {IPv4Address("239.192.2.64")}


def test_listeners_end_with_the_last_owner():
    rig = Rig(peers=2)
    rig.peer.connect()
    rig.peer.open(multicast=True)
    rig.peers[1].connect()
    rig.peers[1].open(**LISTENER)
    rig.peer.run(0.2)
    rig.peer.close(1)
    rig.peer.run(0.1)
    station = rig.station()
    assert not station.device.channels.open
    assert dict(station.device.losses()) == {"owner-gone": 1}


def test_a_multicast_production_goes_on_when_the_connection_that_drove_it_ends():
    rig = Rig(peers=2)
    rig.peer.connect()
    rig.peer.open(multicast=True)
    other = rig.peers[1]
    other.connect()
    assert isinstance(
        other.open(o_size=2, path=io_path(INPUT_ONLY), multicast=True, t_to_o_rpi_us=20_000), ConnectionMade
    )
    rig.peer.run(0.5)
    rig.peer.close(1)
    before = other.received(1)
    rig.peer.run(1.0)
    assert 98 <= other.received(1) - before <= 101, "at the interval that it has"
    assert not other.columns.cpm[other.rows[1][1]].discarded.any(), "the sequence goes on"


@pytest.mark.parametrize(("first", "second"), [(100_000, 10_000), (10_000, 100_000)])
def test_whoever_joins_a_multicast_is_told_the_interval_that_it_has_and_keeps_its_connection(first, second):
    rig = Rig(peers=2)
    rig.peer.connect()
    assert rig.peer.open(multicast=True, t_to_o_rpi_us=first).reply.t_to_o_api_us == first
    other = rig.peers[1]
    other.connect()
    made = other.open(o_size=2, path=io_path(INPUT_ONLY), multicast=True, t_to_o_rpi_us=second)
    assert made.reply.t_to_o_api_us == first
    other.run(1.0)
    rig.peer.close(1)
    other.run(1.0)
    assert not other.columns.cpm[other.rows[1][1]].expirations, "its data never stopped for four intervals"


def test_one_connection_too_many_is_refused_and_its_room_comes_back():
    rig = Rig(peers=5)
    opened(rig)
    for peer in rig.peers[1:4]:
        peer.connect()
        assert isinstance(peer.open(**HEARTBEAT), ConnectionMade)
    last = rig.peers[4]
    last.connect()
    assert refusal(last.open(**HEARTBEAT))[0] == ConnectionStatus.TARGET_OBJECT_OUT_OF_CONNECTIONS
    rig.peers[1].close(1, io_path(INPUT_ONLY))
    assert isinstance(last.open(**HEARTBEAT), ConnectionMade)


# -- what is refused ---------------------------------------------------------------------------------------------------

KEY = ElectronicKey(452, 16, 1, 1, 13)
NOTHING = NetworkParameters(0, ConnectionType.NULL)
WRONG_KEY = emit_epath([ElectronicKey(1, 16, 1, 1, 13)]) + io_path()
ZERO_KEY = emit_epath([ElectronicKey(0, 0, 0, 0, 0)]) + io_path()
OWN_KEY = emit_epath([KEY]) + io_path()


@pytest.mark.parametrize(
    ("changes", "extended"),
    [
        ({"o_size": 66}, (ConnectionStatus.O_TO_T_SIZE, 70)),
        ({"t_size": 70}, (ConnectionStatus.T_TO_O_SIZE, 66)),
        ({"path": io_path(produced=103)}, (ConnectionStatus.INCONSISTENT_APPLICATION_PATHS,)),
        ({"o_to_t": NOTHING, "t_to_o": NOTHING}, (ConnectionStatus.INCONSISTENT_APPLICATION_PATHS,)),
        ({"path": WRONG_KEY}, (ConnectionStatus.VENDOR_OR_PRODUCT_MISMATCH,)),
        ({"t_to_o_rpi_us": 0}, (ConnectionStatus.RPI_NOT_SUPPORTED,)),
        ({"timeout_multiplier": 8}, (ConnectionStatus.TIMEOUT_MULTIPLIER,)),
        ({"transport": TransportClass(2)}, (ConnectionStatus.TRANSPORT_CLASS_AND_TRIGGER,)),
        ({"o_to_t": NetworkParameters(70, ConnectionType.MULTICAST)}, (ConnectionStatus.O_TO_T_CONNECTION_TYPE,)),
        ({"path": io_path(LISTEN_ONLY), "o_size": 2, "multicast": True}, (ConnectionStatus.NO_OWNER_CONNECTION,)),
    ],
)  # fmt: skip
def test_a_forward_open_that_does_not_fit_is_refused_with_its_extended_status(rig, changes, extended):
    rig.peer.connect()
    assert refusal(rig.peer.open(**changes)) == extended
    assert not rig.station().device.channels.open
    assert "connection refused" in rig.texts()


@pytest.mark.parametrize("path", [ZERO_KEY, OWN_KEY, io_path(configuration=None)])
def test_a_key_of_zeros_the_right_one_and_none_are_accepted(rig, path):
    opened(rig, path=path)


# -- explicit messages -------------------------------------------------------------------------------------------------


def test_the_identity_is_the_models_and_shows_faults_and_the_owner(rig):
    rig.peer.connect()
    assert rig.peer.get(IDENTITY, 1, 1).data == (452).to_bytes(2, "little")
    assert rig.peer.get(IDENTITY, 1, 7).data == b"\x03AKD"
    assert rig.peer.get(IDENTITY, 1, 5).data == bytes.fromhex("3000")
    rig.peer.open()
    rig.peer.run(0.1)
    assert rig.peer.get(IDENTITY, 1, 5).data == bytes.fromhex("6100")
    rig.station().raise_fault("F702", hold=False)
    rig.peer.run(0.1)
    assert rig.peer.get(IDENTITY, 1, 5).data == bytes.fromhex("6104")
    assert rig.peer.get(SUPERVISOR, 1, 5).data == b"\1"


def test_parameters_and_attributes_are_written_and_read_back(rig):
    rig.peer.connect()
    number = rig.station().model.resolve("DRV.OPMODE")[0].pnu
    assert rig.peer.set(CONTROLLER, 1, 3, b"\0").status == 0
    assert rig.peer.get(PARAMETER, number, 1).data[:1] == b"\2", "position mode"
    assert rig.peer.get(PARAMETER, 60_000, 1).status == GeneralStatus.PATH_DESTINATION_UNKNOWN
    assert rig.peer.get(0x99, 1, 1).status == GeneralStatus.OBJECT_DOES_NOT_EXIST


def test_the_response_assembly_can_be_read_and_the_command_assembly_not_written(rig):
    enabled(rig)
    assert rig.peer.get(4, 102, 3).data == rig.peer.response
    assert rig.peer.set(4, 101, 3, bytes(64)).status == GeneralStatus.ATTRIBUTE_NOT_SETTABLE
    assert rig.peer.response[0] & 0x80


def test_a_reset_answers_and_then_restarts_the_drive(rig):
    rig.peer.connect()
    assert rig.peer.ask(Service.RESET, logical_path(IDENTITY, 1)).status == 0
    rig.peer.run(1.5)
    assert rig.texts().count("power on") == 1
    rig.peer.connect()
    assert rig.peer.get(IDENTITY, 1, 1).status == 0


def test_a_reset_is_not_put_off_by_one_that_is_asked_for_again(rig):
    rig.peer.connect()
    for _ in range(8):
        assert rig.peer.ask(Service.RESET, logical_path(IDENTITY, 1), seconds=0.01).status == 0
    rig.peer.run(0.03)
    assert rig.texts().count("power on") == 1


def test_settings_of_the_network_survive_a_power_cycle_and_a_reset_to_factory_settings_forgets_them(rig):
    rig.peer.connect()
    assert rig.peer.set(0x48, 1, 5, b"\x2e").status == 0
    assert rig.peer.set(0xF5, 1, 13, (300).to_bytes(2, "little")).status == 0
    rig.station().station.power_cycle(rig.world.now)
    rig.peer.run(1.5)
    rig.peer.connect()
    assert rig.peer.get(0x48, 1, 5).data == b"\x2e"
    assert rig.peer.get(0xF5, 1, 13).data == (300).to_bytes(2, "little")
    rig.peer.ask(Service.RESET, logical_path(IDENTITY, 1), b"\1")
    rig.peer.run(1.5)
    rig.peer.connect()
    assert rig.peer.get(0x48, 1, 5).data == bytes([47])


def test_list_identity_by_broadcast_is_answered_by_each_drive_at_a_time_of_its_own(rig):
    heard = []
    rig.peer.link.sockets.set_user(lambda event, now: heard.append((now, event)))
    ask = bytes.fromhex("6300") + bytes(22)
    rig.peer.link.sockets.act(rig.peer.port.index, Datagram(44818, (IPv4Address("255.255.255.255"), 44818), ask))
    rig.peer.run(3.0)
    answers = [(now, event) for now, event in heard if isinstance(event, DatagramReceived)]
    assert {str(event.peer[0]) for _, event in answers} == {"10.77.0.11", "10.77.0.12"}
    assert len({now for now, _ in answers}) == 2


# -- the supply --------------------------------------------------------------------------------------------------------


def test_a_drive_without_supply_is_silent_and_comes_back_with_other_connection_ids(rig):
    made = opened(rig)
    rig.peer.run(0.1)
    before = rig.peer.received(1)
    station = rig.station()
    station.station.power_off(rig.world.now)
    rig.farm.settle(station.station, rig.world.now)
    rig.peer.run(0.5)
    assert rig.peer.received(1) - before <= 1
    assert not rig.peer.closed, "nothing tells the peer"
    station.station.power_on(rig.world.now)
    rig.farm.settle(station.station, rig.world.now)
    rig.peer.run(1.5)
    rig.peer.silence(1)
    rig.peer.connect()
    again = rig.peer.open()
    assert isinstance(again, ConnectionMade), again
    assert again.reply.o_to_t_id != made.reply.o_to_t_id
    rig.peer.run(0.1)
    assert station.device.connected


def test_the_farms_end_closes_the_sessions_and_counts_no_loss(rig):
    opened(rig)
    rig.peer.run(0.1)
    rig.farm.stop(rig.world.now)
    rig.peer.run(0.1)
    assert rig.peer.closed
    assert not rig.station().device.losses()


# -- the farm file -----------------------------------------------------------------------------------------------------


def test_another_identity_of_the_farm_file_is_the_one_that_keys_are_compared_with():
    identity = "identity: {vendor: 0x1234, product_code: 7, product_name: Press, revision: '2.10'}, model:"
    rig = Rig(DRIVES.replace("model:", identity))
    rig.peer.connect()
    assert refusal(rig.peer.open(path=OWN_KEY))[0] == ConnectionStatus.VENDOR_OR_PRODUCT_MISMATCH
    other = emit_epath([ElectronicKey(0x1234, 16, 7, 2, 10)]) + io_path()
    assert isinstance(rig.peer.open(path=other), ConnectionMade)
    assert rig.peer.get(IDENTITY, 1, 7).data == b"\x05Press"


@pytest.mark.parametrize(
    ("keys", "wrong"),
    [
        ("model: akd-ethernetip", "is missing: a drive on EtherNet/IP needs an address"),
        (
            "model: akd-ethernetip, ip: 10.77.0.11/23, rpi: 5ms",
            "5ms is faster than akd-ethernetip can; the nearest is 10ms",
        ),
        ("model: akd-ethernetip, ip: 10.77.0.11/23, rpi: 1us", "is not a requested packet interval"),
        (
            "model: akd-ethernetip, ip: 10.77.0.11/23, telegram: 9",
            "is a key of PROFINET, and this is a drive on EtherNet/IP",
        ),
        ("model: akd-ethernetip, ip: 10.77.0.11/23, identity: {revision: 1.10}", "is not a text like '1.13'"),
        ("model: akd-ethernetip, ip: 10.77.0.11/23, identity: {device: 3}", "unknown; there are vendor"),
    ],
)
def test_a_wrong_key_of_a_group_is_reported(keys, wrong):
    with pytest.raises(ConfigError, match=re.escape(wrong)):
        parse_farm(f"farm: cip\nlink: {{kind: memory}}\ndrives:\n  - {{name: a, {keys}}}\n")


# -- answers that take time --------------------------------------------------------------------------------------------


def test_a_drive_works_on_parameters_one_after_the_other_and_answers_of_the_standard_do_not_overtake_them():
    rig = Rig(DRIVES.replace("model:", "realism: {parameter_latency: 20ms}, model:"))
    peer = rig.peer
    peer.connect()
    now = rig.world.now
    number = rig.station().model.resolve("DRV.OPMODE")[0].pnu
    paths = [logical_path(PARAMETER, number, 1), logical_path(PARAMETER, number, 1), logical_path(IDENTITY, 1, 1)]
    asked = [peer.originator.request(message_request(Service.GET_ATTRIBUTE_SINGLE, path), now) for path in paths]
    peer.pump()
    answered = []
    for _ in range(50):
        peer.run(0.001)
        answered += [
            (note.number, round((rig.world.now - now) / 1e6))
            for note in peer.notes
            if isinstance(note, RequestAnswered) and note.number not in dict(answered)
        ]
    assert [number for number, _ in answered] == asked
    assert [when for _, when in answered] == [20, 40, 40]


def flooded():
    """A drive with a peer that asks faster than it answers: the next of its questions is too much."""
    rig = Rig(DRIVES.replace("model:", "realism: {parameter_latency: 1s}, model:"), peers=2)
    for peer in rig.peers:
        peer.connect()
    assert isinstance(rig.peers[1].open(), ConnectionMade)
    for _ in range(MOST_HELD):
        ask_on(rig)
    return rig


def ask_on(rig):
    peer = rig.peer
    number = rig.station().model.resolve("DRV.OPMODE")[0].pnu
    path = logical_path(PARAMETER, number, 1)
    peer.originator.request(message_request(Service.GET_ATTRIBUTE_SINGLE, path), rig.world.now)
    peer.originator._pending.clear()
    peer.pump()
    peer.run(0.0001)


def test_a_peer_that_asks_on_and_on_loses_its_stream_and_nobody_elses():
    rig = flooded()
    assert rig.peers[1].get(IDENTITY, 1, 1).status == 0
    ask_on(rig)
    rig.peer.run(0.1)
    assert rig.peer.closed
    assert rig.station().device.discards() == {"held-answers": 1}
    assert not rig.peers[1].closed
    assert rig.peers[1].get(IDENTITY, 1, 1).status == 0
