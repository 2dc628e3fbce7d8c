"""Cyclic data of EtherNet/IP in a capture, in words: what changes, what is missing, layouts from everywhere."""

from ipaddress import IPv4Address, IPv4Interface
from types import SimpleNamespace

import pytest
from cip_tape import IDS, MACS, Tape, behind, command, connect, described, forward_open
from edited_capture import in_fragments

from pnfarm.buses.registry import decoder as make_decoder
from pnfarm.captures.decoder import PlannedDrive
from pnfarm.captures.reading import CapturedFrame
from pnfarm.drives.catalogue import model
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.epath import emit_epath, logical_path

GROUP = IPv4Address("239.192.1.96")


def test_cyclic_data_are_read_by_the_forward_open_and_only_changes_are_lines():
    tape = Tape()
    connect(tape)
    moving = command(0x81, position=1000, velocity=50, up=9, down=8)
    for number, data in enumerate((command(), command(), command(0x80), moving, moving), 1):
        tape.io(0, IDS[0], number, data, header=1)
    for number, status in enumerate((0, 0x84, 0x84, 0x85), 1):
        tape.io(1, IDS[1], number, bytes([status]) + bytes(63))
    assert tape.lines()[4:] == [
        (
            "cyclic: cyclic data begin connection 0x00110001, assembly 101, 64 octets, RPI 10 ms, run; control 0x00 "
            "(none) command 0x06 Position Move position 0 velocity 0"
        ),
        "cyclic: control word 0x00 -> 0x80: enable set",
        "cyclic: control word 0x80 -> 0x81: load start set",
        "cyclic: command 0x06 Position Move: position 1000, velocity 50, acceleration 9, deceleration 8",
        (
            "cyclic: cyclic data begin connection 0x00220002, assembly 102, 64 octets, RPI 10 ms; status 1 0x00 (none) "
            "status 2 0x00 (none) response 0x00 none position 0 velocity 0 motion status 0x00000000"
        ),
        "cyclic: status word 1 0x00 -> 0x84: in position set, enable state set",
        "cyclic: status word 1 0x84 -> 0x85: in motion set",
    ]


def test_an_error_of_a_command_is_shown_with_its_echo():
    tape = Tape()
    connect(tape)
    error = bytes([0x80, 0, 0, 0x34, 0x09, 0xFF, 0x26, 0x20]) + bytes(56)
    for number, data in enumerate((bytes(64), error, error), 1):
        tape.io(1, IDS[1], number, data)
    assert behind(tape.lines(), "cyclic: response error") == [
        "invalid attribute value (0x09, additional 0xFF) of command 0x06 Position Move, response 0x00 none"
    ]


@pytest.mark.parametrize(
    ("kind", "words", "text"),
    [
        (0x27, {"velocity": -5, "up": 1, "down": 2}, "0x07 Jog Move: velocity -5, acceleration 1, deceleration 2"),
        (0x25, {"data": -300}, "0x05 Torque: -300"),
        (0x3B, {"data": 3, "value": 2}, "0x1B Set Attribute: attribute 3 Operation Mode = 2"),
        (0x3F, {"data": 1}, "0x1F Parameter: reads 1 AIN.CUTOFF"),
        (0x3F, {"data": 0x10001, "value": 7}, "0x1F Parameter: writes 1 AIN.CUTOFF = 7"),
        (0x46, {}, "0x06 Position Move of axis 2: position 0, velocity 0, acceleration 0, deceleration 0"),
        (0x29, {}, "0x09 unknown"),
    ],
)
def test_each_type_of_command_has_its_own_words(kind, words, text):
    tape = Tape()
    connect(tape)
    tape.io(0, IDS[0], 1, command(0x80), header=1)
    tape.io(0, IDS[0], 2, command(0x81, kind, **words), header=1)
    assert behind(tape.lines(), "cyclic: command") == [text]


def test_idle_and_run_are_told():
    tape = Tape()
    connect(tape)
    for number, header in enumerate((1, 0, 0, 1), 1):
        tape.io(0, IDS[0], number, command(), header=header)
    assert behind(tape.lines(), "cyclic: run/idle") == ["idle", "run"]


def test_a_silence_and_lost_datagrams_are_told_and_summed_up():
    tape = Tape()
    connect(tape)
    for number, ms in ((1, 10), (2, 10), (3, 10), (12, 90), (13, 10), (15, 20)):
        tape.io(1, IDS[1], number, bytes(64), ms=ms)
    decoder, lines = tape.decoded()
    texts = described(decoder, lines)
    assert behind(texts, "cyclic: gap") == [
        (
            "90.000 ms without a frame (9.0 intervals of 10 ms), 8 frames missing by their numbers; longer than the "
            "timeout of 80 ms"
        )
    ]
    assert behind(texts, "cyclic: missing") == ["1 frames by their numbers"]
    (figures,) = decoder.summary()[0]["cyclic"]
    assert figures["frame_id"] == "0x00220002"
    assert (figures["gaps"], figures["frames_missing"], figures["watchdog_gaps"]) == (1, 9, 1)
    assert figures["cycle_seconds"] == 0.01
    assert figures["interval_min_seconds"] == pytest.approx(0.01)


def test_a_sequence_count_that_freezes_or_goes_back_is_told_once():
    tape = Tape()
    connect(tape)
    for number, count in enumerate((1, 2, 2, 2, 3, 1), 1):
        tape.io(1, IDS[1], number, bytes(64), count=count)
    assert behind(tape.lines(), "cyclic: sequence count") == [
        "stays at 2: data that are the same to the receiver",
        "3 -> 1 (-2)",
    ]


def test_multicast_data_are_found_by_their_producer_and_every_listener_shares_the_channel():
    tape = Tape()
    multicast = fo.NetworkParameters(66, fo.ConnectionType.MULTICAST)
    connect(tape, forward_open(t_to_o=multicast))
    tape.io(1, IDS[1], 1, bytes(64), to=GROUP)
    connect(tape, forward_open(t_to_o=multicast, triad=fo.Triad(8, 1, 1), o_to_t=fo.NetworkParameters(2)))
    tape.io(1, IDS[1], 2, bytes(64), to=GROUP)
    decoder, lines = tape.decoded()
    assert sum(line.description.what == "cyclic data begin" for line in lines) == 1
    (talk,) = [talk for talk in decoder.summary() if talk["cyclic"]]
    assert talk["cyclic"][0]["frames"] == 2


def test_another_device_whose_layout_nobody_knows_is_shown_raw():
    tape = Tape()
    connect(tape, forward_open(path=emit_epath(logical_path(4, 1, None, 2, 3))))
    tape.io(0, IDS[0], 1, bytes(range(68)))
    tape.io(0, 0x99, 1, bytes(range(4)))
    first, second = behind(tape.lines(), "cyclic: cyclic data begin")
    assert first.startswith("connection 0x00110001, assembly 2, 68 octets, RPI 10 ms; 00 01 02")
    assert second == "connection 0x00000099, 00 01 02 03; layout unknown, no Forward_Open in the capture"


def test_data_longer_than_a_frame_come_in_fragments():
    tape = Tape()
    connect(tape, forward_open(large=True, t_to_o=fo.NetworkParameters(2002)))
    for number in (1, 2):
        tape.io(1, IDS[1], number, bytes(2000))
    decoder = make_decoder()
    frames = [
        CapturedFrame(number, time_ns, frame)
        for number, (frame, time_ns) in enumerate(zip(tape.frames, tape.times, strict=True))
    ]
    lines = [line for frame in frames for part in in_fragments(frame, 1480) for line in decoder.feed(part)]
    assert behind(described(decoder, lines), "cyclic: cyclic data begin")[0].startswith(
        "connection 0x00220002, assembly 102, 2000 octets, RPI 10 ms; 00 00"
    )
    (figures,) = decoder.summary()[0]["cyclic"]
    assert figures["frames"] == 2


def test_data_of_another_length_than_agreed_are_told():
    tape = Tape()
    connect(tape)
    tape.io(1, IDS[1], 1, bytes(60))
    assert tape.lines()[-1] == "cyclic: wrong length 60 octets, 64 expected"


def test_a_connection_that_is_opened_again_under_its_old_ids_goes_on_in_the_summary():
    tape = Tape()
    for serial, first in ((7, 1), (8, 1)):
        connect(tape, forward_open(triad=fo.Triad(serial, 1, 1)))
        for number in (first, first + 1, first + 4):
            tape.io(1, IDS[1], number, bytes(64))
    decoder, lines = tape.decoded()
    assert sum(line.description.what == "cyclic data begin" for line in lines) == 2
    (figures,) = next(talk["cyclic"] for talk in decoder.summary() if talk["cyclic"])
    assert (figures["frames"], figures["frames_missing"]) == (6, 4)


def test_data_of_a_variable_length_may_have_fewer_octets_than_agreed():
    tape = Tape()
    sizes = {way: fo.NetworkParameters(size, variable=True) for way, size in (("o_to_t", 70), ("t_to_o", 66))}
    connect(tape, forward_open(**sizes))
    for number, octets in enumerate((64, 40, 20, 0, 64), 1):
        tape.io(1, IDS[1], number, bytes(octets))
        tape.io(0, IDS[0], number, command()[:octets], header=1 if octets else None)
    tape.io(1, IDS[1], 6, bytes(65))
    found = [line for line in tape.lines(every_frame=True) if line.startswith("cyclic")]
    assert [line for line in found if "wrong length" in line] == ["cyclic: wrong length 65 octets, 64 expected"]
    assert found[-1] == "cyclic: wrong length 65 octets, 64 expected"
    assert sum("no octets" in line for line in found) == 2
    assert not any("malformed" in line for line in tape.lines())


def test_a_farm_file_lends_its_layouts_where_no_forward_open_was_captured():
    tape = Tape(opened=False)
    for number, control in enumerate((0, 0x80), 1):
        tape.io(0, 5, number, command(control), header=1)
    connection = SimpleNamespace(output_octets=64, input_octets=64, runs=True, input_header=False)
    plan = SimpleNamespace(
        connection=connection, rpi_ns=10_000_000, timeout_multiplier=4, ip=IPv4Interface("10.77.0.11/24")
    )
    decoder = make_decoder()
    decoder.buses["ethernetip"].expect("plc", MACS[0], [PlannedDrive(MACS[1], model("akd-ethernetip"), plan)])
    lines = [
        line
        for number, (frame, time_ns) in enumerate(zip(tape.frames, tape.times, strict=True))
        for line in decoder.feed(CapturedFrame(number, time_ns, frame))
    ]
    assert behind(described(decoder, lines), "cyclic: control word") == ["0x00 -> 0x80: enable set"]


def test_every_cyclic_frame_is_a_line_if_asked_for():
    tape = Tape()
    connect(tape)
    for number in range(1, 4):
        tape.io(1, IDS[1], number, bytes(64))
    assert len(behind(tape.lines(every_frame=True), "cyclic: cyclic 0x00220002 sequence")) == 2
