"""The decoder over a farm's own frames, over captures of real controllers, and over anything."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import re
import struct
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import record
from recorded_farm import FARM, described, under_faults

from pnfarm.buses.bus import line_of
from pnfarm.buses.profinet.decode.cyclic import status_text
from pnfarm.buses.profinet.decode.decoder import FAMILIES, family_of
from pnfarm.buses.profinet.device.modules import plug_module, pull_module
from pnfarm.buses.registry import BUSES, bus, frame_filters
from pnfarm.buses.registry import decoder as make_decoder
from pnfarm.captures.decoder import family_of as neutral_family_of
from pnfarm.captures.drive_words import drive_state, values_text, words_of
from pnfarm.captures.packet import Packet
from pnfarm.captures.reading import CapturedFrame, FrameReader
from pnfarm.controller.line import VirtualLine
from pnfarm.drives.catalogue import model
from pnfarm.errors import ConfigError
from pnfarm.farm.file.reading import parse_farm
from pnfarm.links.kernel.bpf_capture import KINDS

CAPTURES = Path(__file__).resolve().parents[2].parent / "shared" / "captures"


@pytest.fixture(scope="module")
def farm_capture(tmp_path_factory):
    path = tmp_path_factory.mktemp("capture") / "line-1.pcapng"
    record(FARM, path, under_faults)
    return path


def decoded(path: Path, **options):
    decoder = make_decoder(**options)
    lines = [line for frame in FrameReader(path) for line in decoder.feed(frame)]
    return decoder, lines


def texts(path: Path, **options) -> list[str]:
    decoder, lines = decoded(path, **options)
    return [
        f"{decoder.name(x.source)} -> {decoder.name(x.destination)} {x.description.what} {x.description.text}"
        for x in lines
    ]


def in_order(found: list[str], *wanted: str) -> None:
    """Each of ``wanted`` begins a line, in this order."""
    rest = iter(found)
    for beginning in wanted:
        assert any(line.startswith(beginning) for line in rest), (
            f"no {beginning!r} behind the one before:\n" + "\n".join(found)
        )


# -- a farm


def record_e1(path: Path) -> None:
    text = FARM.replace("akd-profinet", "hiwin-e1").replace("16ms", "4ms")
    record(text[: text.index("  records:")], path, seconds=0.2)


def test_bits_have_the_names_of_the_drives_model(farm_capture, tmp_path):
    """Bits 4 to 6 of STW1 work the AKD's ramp generator; the E1 reserves them in telegram 3 (its manual, 3.3.1)."""
    path = tmp_path / "e1.pcapng"
    record_e1(path)
    names = []
    for capture in (farm_capture, path):
        decoder, _ = decoded(capture)
        templates = [channel.template for channel in decoder.buses["profinet"].shared.channels.values()]
        axes = [axis for t in templates if t is not None for axis in t.axes]
        names.append({axis.bits["STW1"][4:7] for axis in axes if "STW1" in axis.bits})
    assert names == [{("enable_ramp_generator", "unfreeze_ramp_generator", "enable_setpoint")}, {("", "", "")}]


def test_a_sign_of_life_that_runs_is_not_worth_a_line(tmp_path):
    path = tmp_path / "e1.pcapng"
    record_e1(path)
    found = texts(path)
    assert any("telegram 3" in line for line in found)
    assert any(line.startswith("plc -> axis-01 STW1") and "enable operation set" in line for line in found)
    assert not any(line.startswith(("plc -> axis-01 STW2", "axis-01 -> plc ZSW2")) for line in found)


def test_words_of_bits_are_hexadecimal_and_quantities_are_decimal(tmp_path):
    path = tmp_path / "e1.pcapng"
    record_e1(path)
    line = [line for line in texts(path, every_frame=True) if "NIST_B" in line][-1]
    assert re.search(r"ZSW1 0x[0-9A-F]{4} NIST_B -?\d+ ZSW2 0x[0-9A-F]{4} G1_ZSW 0x[0-9A-F]{4} G1_XIST1 -?\d+ ", line)


def test_a_start_up_in_words(farm_capture):
    in_order(
        [line for line in texts(farm_capture) if "axis-01" in line],
        "axis-01 -> everybody ARP probes 10.77.0.11",
        "plc -> all DCP Identify.req name axis-01",
        "axis-01 -> plc DCP Identify.res name axis-01, IP 10.77.0.11 mask 255.255.255.0",
        "plc -> axis-01 Connect.req AR ",
        "axis-01 -> plc Connect.res OK, input frame id 0x8000, output frame id 0x80",
        "plc -> axis-01 Write.req API 0x3A00 slot 1 subslot 0x0001 index 0xB02E (parameter access): "
        "change parameter PNU 930 ",
        "axis-01 -> plc Write.res OK, API 0x3A00 slot 1",
        "plc -> axis-01 PrmEnd.req AR ",
        "axis-01 -> plc ApplicationReady.req AR ",
        "plc -> axis-01 ApplicationReady.res OK",
    )


def test_a_connect_shows_cycle_watchdog_and_telegram(farm_capture):
    (line,) = [line for line in texts(farm_capture) if line.startswith("plc -> axis-01 Connect.req")]
    assert line.endswith(
        "legacy start-up, cycle 16 ms, watchdog 3 x, telegram 1 (module 0x10001), input frame id 0x8000"
    )


def test_of_cyclic_frames_only_changes_are_shown(farm_capture):
    lines = [line for line in texts(farm_capture) if "axis-01" in line and ("STW1" in line or "ZSW1" in line)]
    in_order(
        lines,
        "plc -> axis-01 cyclic data begin frame id 0x8001, 40 octets, cycle 16 ms, telegram 1, data good; STW1 0x0476",
        "plc -> axis-01 STW1 0x0476 -> 0x0477: on set",
        "axis-01 -> plc ZSW1 0x2331 -> 0x2333: S2 -> S3 switched on",
        "plc -> axis-01 STW1 0x0477 -> 0x047F: enable operation set",
        "axis-01 -> plc ZSW1 0x2333 -> 0x2337: S3 -> S4 operation",
        "axis-01 -> plc ZSW1 0x2337 -> 0x2378: S4 -> S1 switching on inhibited; fault present set",
        "plc -> axis-01 STW1 0x047F -> 0x0476: on reset, enable operation reset",
        "plc -> axis-01 STW1 0x0476 -> 0x04F6: fault acknowledge set",
        "axis-01 -> plc ZSW1 0x2378 -> 0x2331: S1 -> S2 ready for switching on; fault present reset",
    )
    assert len(lines) < 30


def test_a_silence_and_its_end_in_words(farm_capture):
    in_order(
        [line for line in texts(farm_capture, gap_cycles=2.5) if "axis-02" in line],
        "axis-02 -> plc gap 48.000 ms without a frame (3.0 cycles of 16 ms), 2 frames missing by the cycle counter",
        "axis-02 -> plc DataStatus 0x35 -> 0x25: stop",
        "axis-02 -> plc DataStatus 0x25 -> 0x35: run",
        "plc -> axis-02 ERR-RTA AR consumer DHT/WDT expired (RTA_ERR_ABORT) (CF 81 FD 05); "
        "last cyclic frame of axis-02 ",
        "plc -> axis-02 Connect.req",
        "plc -> axis-02 Release.req AR ",
    )


def reads_and_pulls_modules(line: VirtualLine) -> None:
    for subslot, index in ((0x8000, 0x8080), (0x8001, 0x802A), (1, 0xF841)):
        line.plc.read_record("axis-01", (0, 0, subslot, index), line.world.now)
    line.world.run(0.5)
    station = line.farm.axis("axis-01")
    for hand in (
        lambda: pull_module(station.device, 1, 2, line.world.now),
        lambda: pull_module(station.device, 1, None, line.world.now),
        lambda: plug_module(station.device, 1, line.world.now),
    ):
        hand()
        line.farm.settle(station.station, line.world.now)
        line.world.run(0.5)


@pytest.fixture(scope="module")
def reads_and_pulls(tmp_path_factory):
    path = tmp_path_factory.mktemp("capture") / "reads.pcapng"
    record(FARM, path, reads_and_pulls_modules)
    return texts(path)


def test_records_that_were_read_are_shown_by_their_fields_in_one_line(reads_and_pulls):
    in_order(
        [line for line in reads_and_pulls if "axis-01 -> plc Read.res OK" in line],
        "axis-01 -> plc Read.res OK, slot 0 subslot 0x0001 index 0xAFF0 (I&M0), 60 octets: "
        "Im0 vendor_id 261 (0x105), order_id AKD-P00306-NBPN-0000, serial_number ",
        "axis-01 -> plc Read.res OK, slot 0 subslot 0x0001 index 0xAFF1 (I&M1), 60 octets: ImText text -",
        "axis-01 -> plc Read.res OK, slot 0 subslot 0x8000 index 0x8080 (PDInterfaceDataReal), 36 octets: "
        "InterfaceDataReal name axis-01, mac ",
        "axis-01 -> plc Read.res OK, slot 0 subslot 0x8001 index 0x802A (PDPortDataReal), 72 octets: "
        "PortDataReal slot 0, subslot 32769 (0x8001), own_port_name port-001, peers ((port_name port-001, "
        "station_name plc, ",
        "axis-01 -> plc Read.res OK, slot 0 subslot 0x0001 index 0xF841 (PDRealData), 204 octets: "
        "MultipleBlock api 0, slot 0, subslot 32768 (0x8000), blocks ((InterfaceDataReal name axis-01, ",
    )
    assert max(map(len, reads_and_pulls)) < 400


def test_alarms_and_their_acknowledgements_name_a_place_alike_and_a_module_as_one(reads_and_pulls):
    found = [line for line in reads_and_pulls if " Alarm " in line or " AlarmAck " in line]
    in_order(
        found,
        "axis-01 -> plc Alarm submodule pulled on slot 1 subslot 0x0002 (low priority, ",
        "plc -> axis-01 AlarmAck submodule pulled on slot 1 subslot 0x0002: taken (low priority, ",
        "axis-01 -> plc Alarm module pulled on slot 1 (low priority, ",
        "plc -> axis-01 AlarmAck module pulled on slot 1: taken (low priority, ",
        "axis-01 -> plc Alarm submodule plugged on slot 1 subslot 0x0001 (low priority, ",
    )
    assert not any("subslot 0x0000" in line for line in found)


def test_the_summary_counts_what_happened(farm_capture):
    decoder, _ = decoded(farm_capture)
    talks = {tuple(talk["between"]): talk for talk in decoder.summary()}
    one, two = talks["axis-01", "plc"], talks["axis-02", "plc"]
    assert one["counts"]["connects"] == 1
    assert "aborts" not in one["counts"]
    assert two["counts"]["connects"] == 2
    assert two["reasons"]["aborts"] == {"AR consumer DHT/WDT expired (RTA_ERR_ABORT) (CF 81 FD 05)": 1}
    for channel in one["cyclic"]:
        assert channel["interval_min_seconds"] == channel["interval_max_seconds"] == channel["cycle_seconds"] == 0.016
        assert (channel["gaps"], channel["counter_jumps"], channel["frames_missing"]) == (0, 0, 0)
    assert sum(channel["frames_missing"] for channel in two["cyclic"]) == 2
    assert sum(one["families"].values()) == one["frames"]


def test_every_frame_is_a_line_when_asked_for(farm_capture):
    decoder, lines = decoded(farm_capture, every_frame=True)
    cyclic = [line for line in lines if line.description.what in {"cyclic", "cyclic data begin"}]
    assert len(cyclic) == sum(c.frames for c in decoder.buses["profinet"].shared.channels.values())
    assert any("NSOLL_A" in line.description.text for line in cyclic)


def test_a_broadcast_to_every_drive_is_one_line(farm_capture):
    lines = [line for line in texts(farm_capture) if "Identify.req name axis-01" in line]
    assert len(lines) == 1


def test_a_world_ends_the_same_with_and_without_a_capture():
    def course(pcap: Path | None) -> tuple:
        line = asyncio.run(VirtualLine.create(parse_farm(FARM), pcap=pcap, epoch_ns=0))
        line.world.run(3.0)
        if pcap is not None:
            asyncio.run(line.close())
        return [(int(a.motor.position * 1e9), int(a.drive.state)) for a in line.farm.columns.axis], [
            (int(c.received), int(c.counter)) for c in line.farm.columns.cpm
        ]

    assert course(None) == course(Path("/dev/null"))


# -- cyclic frames alone


def cyclic(number: int, data: bytes, *, frame_id: int = 0x8001, status: int = 0x35, counter: int | None = None,
           at: int | None = None) -> CapturedFrame:  # fmt: skip
    time_ns = number * 4_000_000 if at is None else at
    count = number * 128 if counter is None else counter
    body = struct.pack(">H", frame_id) + data.ljust(40, b"\0") + struct.pack(">HBB", count & 0xFFFF, status, 0)
    return CapturedFrame(number + 1, time_ns, b"\x02\0\0\0\0\x02" + b"\x02\0\0\0\0\x01" + b"\x88\x92" + body)


def test_frames_without_a_connect_are_judged_by_their_counter():
    frames = [cyclic(n, b"\x01") for n in range(10)]
    frames += [cyclic(10, b"\x02", status=0x25), cyclic(15, b"\x02", status=0x35), cyclic(16, b"", counter=9)]
    assert described(frames) == [
        "cyclic data begin frame id 0x8001, 40 octets, data good; layout unknown, no Connect in the capture",
        "DataStatus 0x35 -> 0x25: stop",
        "gap 20.000 ms without a frame (5.0 cycles of 4 ms), 4 frames missing by the cycle counter",
        "DataStatus 0x25 -> 0x35: run",
        "cycle counter 1920 -> 9 (-1911, +128 expected)",
    ]


def test_a_cycle_counter_that_stays_is_shown_and_then_only_counted():
    frames = [cyclic(n, b"") for n in range(4)] + [cyclic(n, b"", counter=384) for n in range(4, 200)]
    lines = [line for line in described(frames) if line.startswith("cycle counter")]
    assert lines[0] == "cycle counter 384 -> 384 (stays)"
    assert lines[-1].endswith("further ones on this channel are not shown")
    assert len(lines) == 50


def test_frames_out_of_order_by_some_microseconds_are_not_shown():
    frames = [cyclic(n, b"") for n in range(20)]
    frames[10] = replace(frames[10], time_ns=frames[9].time_ns - 5000)
    assert len(described(frames)) == 1


def test_the_status_of_a_frame_that_the_capture_cut_off_is_not_guessed():
    frames = [cyclic(n, b"\x01") for n in range(3)]
    decoder = make_decoder()
    found = [decoder.feed(replace(frame, data=frame.data[:-6], cut=6)) for frame in frames]
    assert [line.description.text for lines in found for line in lines] == [
        "frame id 0x8001; only times count, 6 octets of a frame are not in the capture"
    ]
    (figures,) = decoder.summary()[0]["cyclic"]
    assert (figures["frames"], figures["interval_max_seconds"]) == (3, 0.004)


@pytest.mark.parametrize(
    ("telegram", "text"),
    [
        (4, "ZSW1 0x0001 NIST_B 0 ZSW2 0x0000 G1_ZSW 0x0000 G1_XIST1 0 G1_XIST2 0 G2_ZSW 0xA000 G2_XIST1 0 G2_XIST2 0"),
        (20, "ZSW1 0x0001 NIST_A_GLATT 0 IAIST_GLATT 0 MIST_GLATT 0 PIST_GLATT 0 MELD_NAMUR 0xA000"),
        (112, "VIST_F -1.5"),
    ],
)
def test_each_word_is_a_number_or_bits_as_its_telegram_has_it(telegram, text):
    values = {"ZSW1": b"\0\1", "G2_ZSW": b"\xa0\0", "MELD_NAMUR": b"\xa0\0", "VIST_F": struct.pack(">f", -1.5)}
    words = words_of(model("profidrive").profidrive.telegrams[telegram].input)
    data = bytearray(64)
    for name, place, octets in (word[:3] for word in words):
        data[place : place + octets] = values.get(name, bytes(octets))
    assert text in values_text(words, bytes(data))
    assert values_text(words, bytes(data[:3])) == "ZSW1 0x0001"


@pytest.mark.parametrize(
    ("zsw1", "stw1", "state"),
    [(0x0240, 0x0476, "S1"), (0x0231, 0x0476, "S2"), (0x0233, 0x0477, "S3"), (0x0237, 0x047F, "S4"),
     (0x0233, 0x047E, "S5"), (0x0237, 0x047B, "S5"), (0x023B, 0x047F, "S5"), (0x0237, None, "S4"), (0x0000, None, "")],
)  # fmt: skip
def test_states_by_the_status_word(zsw1, stw1, state):
    assert drive_state(zsw1, stw1).partition(" ")[0] == state


def test_the_data_status_in_words():
    assert status_text(0x35) == "data good"
    assert status_text(0x11) == "primary, data invalid, run, station problem"
    assert status_text(0x25, 0x35) == "stop"


# -- captures of real controllers


def real(name: str) -> list[str]:
    path = CAPTURES / f"{name}.pcap"
    if not path.exists():
        pytest.skip(f"the captures of real controllers are not here: no {path.name} beside the project")
    return texts(path)


def test_the_start_up_of_a_real_drive():
    in_order(
        real("drive_connect_api3a00"),
        "pn-io-1 -> 00:1b:08:04:72:e8 RPC ping",
        "00:1b:08:04:72:e8 -> pn-io-1 RPC nocall",
        "pn-io-1 -> 00:1b:08:04:72:e8 Connect.req AR 7d3a7927, legacy start-up, cycle 4 ms, watchdog 3 x, "
        "slot 0 module 0x2, slot 1 module 0x100, input frame id 0x8061",
        "00:1b:08:04:72:e8 -> pn-io-1 Connect.res OK, module difference: slot 1 subslot 0x0001 substitute",
        "pn-io-1 -> 00:1b:08:04:72:e8 PrmEnd.req",
        "00:1b:08:04:72:e8 -> pn-io-1 ApplicationReady.req",
    )


def test_the_start_up_of_a_real_controller_and_its_cyclic_data():
    found = real("dacookie_connectrequest")
    in_order(
        found,
        "plcxb1.profinet-schnittstellexb15ee1 -> all DCP Identify.req name io-devicexb15b32",
        "io-devicexb15b32 -> plcxb1.profinet-schnittstellexb15ee1 ARP 192.168.0.10 is at 28:63:36:e8:91:74",
        "plcxb1.profinet-schnittstellexb15ee1 -> io-devicexb15b32 Connect.req AR 6cb0b8fb, advanced start-up, "
        "cycle 2 ms, watchdog 3 x",
        "plcxb1.profinet-schnittstellexb15ee1 -> io-devicexb15b32 Write.req 15 records: ",
        "io-devicexb15b32 -> plcxb1.profinet-schnittstellexb15ee1 Write.res OK, 15 records",
        "io-devicexb15b32 -> plcxb1.profinet-schnittstellexb15ee1 IOPS of all bad (subslot) -> good",
        "plcxb1.profinet-schnittstellexb15ee1 -> io-devicexb15b32 IOCS of all bad (controller) -> good",
    )
    assert not any("gap" in line or "counter" in line for line in found)
    assert len(found) < 40
    # its device sends data before it answers
    begun = [n for n, line in enumerate(found) if "-> plcxb1.profinet-schnittstellexb15ee1 cyclic data begin" in line]
    (answer,) = [n for n, line in enumerate(found) if "Connect.res" in line]
    assert len(begun) == 1
    assert begun[0] < answer
    assert not any("layout unknown" in line for line in found)


def test_alarms_and_their_end_of_a_real_controller():
    in_order(
        real("pnio-rs_s7-1515_golden"),
        "plcxbbench.profinetxainterfacexb25fbd -> rt-labs-dev Connect.req" if False else "rt-labs-dev -> ",
        "ec:1c:5d:61:e7:3f"
        if False
        else "plcxbbench.profinetxainterfacexb25fbd -> rt-labs-dev DCP Set.req "
        "IP 172.16.2.10 mask 255.255.255.0 gateway 172.16.2.10 (until power off)",
        "rt-labs-dev -> ec:1c:5d:61:e7:3c alarm ",
        "ec:1c:5d:61:e7:3c -> rt-labs-dev ERR-RTA AR faulty alarm indication (RTA_ERR_ABORT) (CF 81 FD 0B)",
        "ec:1c:5d:61:e7:3c -> rt-labs-dev Read.req slot 0 subslot 0x8000 index 0xAFF0 (I&M0)",
        "rt-labs-dev -> ec:1c:5d:61:e7:3c Read.res OK, slot 0 subslot 0x8000 index 0xAFF0 (I&M0), 60 octets",
    )


# -- anything


def test_the_table_has_every_kind_of_frame():
    """What `--only` knows is what the decoders know, and what a capture's filter in the kernel knows."""
    assert set(FAMILIES) - {"other"} == set(bus("profinet").frame_families)
    networks = {family for one in BUSES.values() if not line_of(one) for family in one.frame_families}
    # the kernel has no telegrams of lines
    lines = {family for one in BUSES.values() if line_of(one) for family in one.frame_families} - networks
    assert set(frame_filters()) - lines == networks | {"acyclic", "arp", "icmp", "other"} == set(KINDS)
    known = {word: families - lines for word, families in frame_filters().items() if word not in lines}
    assert {word: families for word, families in known.items() if KINDS[word] != families} == {}


@given(st.integers(0, 0xFFFF), st.binary(max_size=80))
def test_every_frame_has_a_family(ethertype, payload):
    assert family_of(ethertype, payload) in {*FAMILIES, None}
    assert neutral_family_of(Packet(0, bytes(6), bytes(6), ethertype, payload)) in {"arp", "icmp", "other"}


FRAME = st.builds(
    lambda to, source, head, rest: to + source + head + rest,
    st.sampled_from([b"\x02\0\0\0\0\x01", b"\x01\x0e\xcf\0\0\0"]),
    st.sampled_from([b"\x02\0\0\0\0\x01", b"\x02\0\0\0\0\x02"]),
    st.sampled_from(
        [bytes.fromhex(x) for x in ("88928001", "8892fe01", "8892fefd", "8892fefe", "8892feff", "0806", "88cc", "0800",
                                    "8100c00088928001", "080045000100000000004011", "0005", "")]
    ),
    st.binary(max_size=300),
)  # fmt: skip


@settings(max_examples=300)
@given(st.lists(st.one_of(FRAME, st.binary(max_size=80)), max_size=12), st.booleans())
def test_any_frames_give_lines_and_no_exception(frames, every):
    decoder = make_decoder(every_frame=every)
    for number, data in enumerate(frames):
        for line in decoder.feed(CapturedFrame(number, number * 1_000_000, data)):
            assert line.description.what
            decoder.as_dict(line)
    decoder.summary()


@pytest.fixture(scope="module")
def frames(farm_capture):
    return [frame for frame in FrameReader(farm_capture) if family_of_frame(frame) != "cyclic"]


def family_of_frame(frame: CapturedFrame) -> str:
    return family_of(int.from_bytes(frame.data[12:14], "big"), frame.data[14:])


@settings(max_examples=200)
@given(st.data())
def test_a_farms_frames_with_wrong_octets_give_lines_and_no_exception(frames, data):
    decoder = make_decoder()
    for frame in frames[:60]:
        octets = bytearray(frame.data)
        if data.draw(st.booleans()):
            octets[data.draw(st.integers(12, len(octets) - 1))] = data.draw(st.integers(0, 255))
        decoder.feed(replace(frame, data=bytes(octets)))


@settings(max_examples=300)
@given(st.binary(max_size=400))
def test_any_octets_are_frames_or_an_error(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("any") / "any.pcap"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=r"any\.pcap"):
        list(FrameReader(path))


MAGICS = [bytes.fromhex(x) for x in ("d4c3b2a1", "a1b2c3d4", "4d3cb2a1", "a1b23c4d", "0a0d0d0a1c0000004d3c2b1a")]


@settings(max_examples=300)
@given(st.sampled_from(MAGICS), st.binary(max_size=400), st.booleans())
def test_any_octets_after_a_captures_beginning_are_frames_or_an_error(tmp_path_factory, magic, content, packed):
    path = tmp_path_factory.mktemp("any") / "any.pcap"
    path.write_bytes(gzip.compress(magic + content) if packed else magic + content)
    with contextlib.suppress(ConfigError):
        for frame in FrameReader(path):
            assert frame.number


@settings(max_examples=100)
@given(st.data())
def test_a_capture_that_is_cut_gives_its_whole_frames(farm_capture, tmp_path_factory, data):
    content = farm_capture.read_bytes()
    path = tmp_path_factory.mktemp("cut") / "cut.pcapng"
    path.write_bytes(content[: data.draw(st.integers(1000, 20_000))])
    whole = [frame.data for frame, _ in zip(FrameReader(farm_capture), range(200), strict=False)]
    found = [frame.data for frame in FrameReader(path)]
    assert found == whole[: len(found)]


def test_frames_of_another_link_type_are_reported(tmp_path):
    path = tmp_path / "any.pcap"
    path.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 113))
    with pytest.raises(ConfigError, match="holds frames of link type 113, not of Ethernet"):
        list(FrameReader(path))
