"""`pnfarm decode` and `up --pcap` as a user runs them."""

from __future__ import annotations

import json
import re
import signal
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recorded import record, write_frames
from scapy.utils import RawPcapNgReader
from wireshark import tshark

from pnfarm.captures.reading import FrameReader
from pnfarm.farm.file.reading import parse_farm
from pnfarm.links.capture.pcap import packet_block, section_header
from pnfarm.protocols.profinet.wire.dcp.blocks import NameBlock
from pnfarm.protocols.profinet.wire.dcp.pdu import (
    DCP_IDENTIFY_RESPONSE,
    SERVICE_IDENTIFY,
    TYPE_SUCCESS,
    DcpPdu,
    emit_dcp,
)

CONFIGS = Path(__file__).parents[2] / "configs"
PROFIBUS_DL = 257
FARM = """\
farm: pcaptest
link: {kind: veth}
api: off
drives:
  - name: axis-{n:02}
    count: 3
    model: akd-profinet
    ip: 10.77.0.11/24
controller:
  name: plc
  ip: 10.77.0.1/24
  cycle: 16ms
  watchdog_factor: 20
  program: {kind: sine, speed_rpm: 60, period: 4s, acknowledge_after: 200ms}
  reconnect: {after: 200ms}
"""


def is_cyclic(data: bytes) -> bool:
    """A frame id of RT class 1, behind a VLAN tag or not."""
    return (data[16:19] if data[12:14] == b"\x81\x00" else data[12:15]) == b"\x88\x92\x80"


@pytest.fixture(scope="module")
def virtual(tmp_path_factory):
    """A capture of a line in virtual time, and its farm file."""
    folder = tmp_path_factory.mktemp("virtual")
    record(FARM.replace("{kind: veth}", "{kind: memory}"), folder / "line.pcapng", seconds=0.5)
    (folder / "line.pnfarm.yml").write_text(FARM)
    return folder / "line.pcapng"


def test_a_capture_is_shown_line_by_line(pnfarm, virtual):
    found = pnfarm("decode", virtual)
    assert (found.code, found.err) == (0, "")
    pattern = r"\d\d:\d\d:\d\d\.\d{6} plc -> axis-01 Connect\.req AR .*cycle 16 ms, watchdog 20 x, telegram 1"
    assert re.search(pattern, found.out)


@pytest.mark.parametrize("other", ["axis-02", "axis-03"])
def test_only_the_drives_that_were_asked_for(pnfarm, virtual, other):
    found = pnfarm("decode", virtual, "--drive", "axis-01")
    assert "axis-01" in found.out
    assert other not in found.out


def test_a_drive_can_be_named_by_its_address(pnfarm, virtual):
    named = pnfarm("decode", virtual, "--drive", "axis-01").out
    with RawPcapNgReader(str(virtual)) as reader:
        mac = next(data[6:12] for data, meta in reader if meta.ifname == b"axis-01" and meta.direction == 2)
    assert pnfarm("decode", virtual, "--drive", mac.hex("-").upper()).out == named


@pytest.mark.parametrize("options", [(), ("--summary",), ("--format", "json"), ("--only", "dcp")])
@pytest.mark.parametrize("who", ["nosuch", "02:00:00:00:00:99"])
def test_a_drive_that_is_not_in_the_capture_is_reported_with_those_that_are(pnfarm, virtual, who, options):
    found = pnfarm("decode", virtual, "--drive", who, *options)
    assert found.code == 2
    (sentence,) = found.err.splitlines()
    assert sentence.startswith(f"pnfarm: station '{who}' is not in {virtual}; it has frames of ")
    assert {"plc", "axis-01", "axis-02", "axis-03"} <= set(re.split(r"[ ,]+", sentence))


def test_of_two_drives_the_one_in_the_capture_is_still_shown(pnfarm, virtual):
    both = pnfarm("decode", virtual, "--drive", "axis-01", "--drive", "nosuch")
    assert (both.code, both.out) == (2, pnfarm("decode", virtual, "--drive", "axis-01").out)
    assert "'nosuch'" in both.err
    # there, though nothing of the kind is from it
    nothing = pnfarm("decode", virtual, "--drive", "axis-01", "--only", "snmp")
    assert (nothing.code, nothing.out, nothing.err) == (0, "", "")


def test_only_the_kinds_that_were_asked_for(pnfarm, virtual):
    lines = pnfarm("decode", virtual, "--only", "dcp", "--only", "arp", "--format", "json").out.splitlines()
    assert {json.loads(line)["family"] for line in lines} == {"dcp", "arp"}


def test_a_line_of_json_has_all_parts(pnfarm, virtual):
    lines = [json.loads(line) for line in pnfarm("decode", virtual, "--format", "json").out.splitlines()]
    (connect,) = [x for x in lines if x["what"] == "Connect.req" and x["to"] == "axis-02"]
    assert connect["from"] == "plc"
    assert connect["family"] == "rpc"
    assert connect["startup"] == "legacy"
    state = next(x for x in lines if x["what"] == "ZSW1" and x["from"] == "axis-02" and x["after"] & 0x47 == 0x07)
    assert state["text"].endswith("S3 -> S4 operation")


def test_the_summary_is_a_paragraph_for_each_two_stations(pnfarm, virtual):
    lines = pnfarm("decode", virtual, "--summary", "--drive", "axis-01").out.splitlines()
    assert lines[0].startswith("axis-01 <-> plc: ")
    assert any("cycle 16 ms, min/mean/max 16 ms / 16 ms / 16 ms" in line for line in lines)
    assert "  1 connects, 5 reads" in lines
    assert not any("axis-02" in line for line in lines)


def test_the_summary_as_json(pnfarm, virtual):
    talks = json.loads(pnfarm("decode", virtual, "--summary", "--format", "json").out)["conversations"]
    assert {"axis-01", "plc"} in [set(talk["between"]) for talk in talks]


def test_a_farm_file_lends_its_layouts_where_no_connect_was_captured(pnfarm, virtual, tmp_path):
    late = tmp_path / "late.pcapng"
    content = virtual.read_bytes()
    place, kept, cyclic = 0, b"", 0
    while place < len(content):
        length = int.from_bytes(content[place + 4 : place + 8], "little")
        block = content[place : place + length]
        is_packet = int.from_bytes(block[:4], "little") == 6
        if not is_packet or is_cyclic(block[28:]):
            kept += block
            cyclic += is_packet
        place += length
    late.write_bytes(kept)
    assert cyclic > 100
    bare = pnfarm("decode", late).out
    assert "layout unknown, no Connect in the capture" in bare
    assert "STW1" not in bare
    known = pnfarm("decode", late, "--farm", virtual.with_name("line.pnfarm.yml")).out
    assert re.search(r"plc -> axis-01 STW1 0x0477 -> 0x047F: enable operation set", known)
    assert re.search(r"axis-01 -> plc ZSW1 .* S3 -> S4 operation", known)


def test_a_file_that_is_no_capture_is_an_error_in_one_sentence(pnfarm, tmp_path):
    (tmp_path / "text.pcap").write_text("no capture at all")
    (tmp_path / "empty.pcap").write_bytes(b"")
    for name, words in (
        ("text.pcap", "is not a capture: give a pcap or pcapng file"),
        ("empty.pcap", "is not a capture: give a pcap or pcapng file"),
        ("nowhere.pcap", "cannot be read: No such file or directory"),
        (".", "cannot be read: Is a directory"),
    ):
        found = pnfarm("decode", tmp_path / name)
        assert (found.code, found.out) == (2, "")
        assert found.err == f"pnfarm: {tmp_path / name} {words}\n"


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=300), st.booleans())
def test_any_file_gives_lines_or_an_error_in_one_sentence(pnfarm, tmp_path, content, like_a_capture):
    path = tmp_path / "any.pcap"
    path.write_bytes((bytes.fromhex("d4c3b2a1") if like_a_capture else b"") + content)
    found = pnfarm("decode", path)
    assert found.code in {0, 2}
    assert "Traceback" not in found.err
    assert (found.code == 2) <= found.err.startswith("pnfarm: ")


def test_a_stamp_beyond_any_calendar_is_shown_in_seconds(pnfarm, tmp_path):
    file = tmp_path / "far.pcapng"
    # stamps are microseconds where the interface does not say otherwise
    interface = struct.pack("<IIHHII", 1, 20, 1, 0, 0, 20)
    arp = bytes.fromhex("ffffffffffff02000000000108060001080006040001020000000001c0a80001000000000000c0a80002")
    file.write_bytes(section_header() + interface + packet_block(0, arp, (1 << 64) - 1, "in"))
    found = pnfarm("decode", file)
    assert (found.code, found.err) == (0, "")
    assert found.out.startswith("18446744073709.551615 02:00:00:00:00:01 -> everybody ARP who has 192.168.0.2?")


def test_an_unknown_kind_is_an_error_in_one_sentence(pnfarm, virtual):
    found = pnfarm("decode", virtual, "--only", "cyclical")
    assert found.code == 2
    assert found.err.startswith("pnfarm: unknown kind of frame 'cyclical', allowed are cyclic, ")


def test_a_capture_that_ends_in_the_middle_says_so(pnfarm, virtual, tmp_path):
    path = tmp_path / "cut.pcapng"
    path.write_bytes(virtual.read_bytes()[:-10])
    found = pnfarm("decode", path)
    assert found.code == 0
    assert "the file cannot be read to its end: the packet or block at octet " in found.err


# -- up --pcap


@pytest.fixture
def file(tmp_path, network):
    path = tmp_path / "pcaptest.pnfarm.yml"
    path.write_text(FARM)
    return path


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--pcap", "OUT", "--pcap-only", "cyclical"], 2, "unknown kind of frame 'cyclical'"),
        (["--pcap", "OUT", "--pcap-size", "10kB"], 2, "a file of 10kB is too small for a capture"),
        (["--pcap", "OUT", "--pcap-size", "lots"], 2, "'lots' is not a size"),
        (["--pcap", "OUT", "--pcap-drives", "motor-*"], 2, "no drive of the farm is called 'motor-*'"),
        (["--pcap-size", "10MB"], 2, "name the capture's file: --pcap OUT.pcapng"),
        (["--pcap", "NOWHERE/OUT"], 4, "cannot be written: No such file or directory"),
        (["--pcap", "/dev/full"], 4, "capture /dev/full cannot be written: No space left on device"),
    ],
)
def test_impossible_capture_options_are_an_error_in_one_sentence(
    process, file, tmp_path, network, options, code, words
):
    found = process("up", file, *(o.replace("OUT", str(tmp_path / "out")) for o in options))
    assert found.code == code
    assert words in found.err.splitlines()[-1]
    assert "pf" not in re.sub(r"lo:.*", "", network("-o", "link").split("\n", 1)[-1])


def test_a_capture_of_a_farm_at_work(background, process, file, tmp_path, network):
    """Environment and flags; one drive only; acyclic and cyclic frames, both ways; nothing malformed."""
    out = tmp_path / "out.pcapng"
    up = background("up", file, "--pcap", out, PNFARM_UP_PCAP_DRIVES="axis-02")
    up.wait_for("capture started")
    plc = background("plc", file, "--seconds", "60")
    plc.wait_for('"axis running"')
    during = process("decode", out)  # while it is being written
    assert during.code == 0
    assert "plc -> axis-02 Connect.req" in during.out
    assert plc.stop(signal.SIGTERM) == 0
    assert up.stop(signal.SIGTERM) == 0
    assert "capture ended" in up.err + up.out
    told = process("decode", out).out
    for words in (
        "DCP Identify.req name axis-02", "DCP Identify.res name axis-02", "plc -> axis-02 Connect.req",
        "axis-02 -> plc Connect.res OK", "axis-02 -> plc ApplicationReady.req", "plc -> axis-02 STW1 ",
        "axis-02 -> plc ZSW1 ", "plc -> axis-02 Release.req",
    ):  # fmt: skip
        assert words in told, words
    assert not re.search(r"axis-0[13] -> (?!all |everybody )|-> axis-0[13] ", told)  # multicast reaches every port
    with RawPcapNgReader(str(out)) as reader:
        cyclic = [meta.direction for data, meta in reader if is_cyclic(data)]
    assert abs(cyclic.count(1) - cyclic.count(2)) < 20
    assert cyclic.count(1) > 10
    assert tshark(out, "-Y", "_ws.malformed || !(pn_dcp || pn_rt || arp || dcerpc || icmp || lldp)") == ""
    facts = subprocess.run(["capinfos", str(out)], capture_output=True, text=True, check=True).stdout
    assert "Name = axis-02" in facts
    assert "Number of interfaces in file: 1" in facts
    assert "pnfarm farm pcaptest" in facts


def test_a_ring_of_files_of_cyclic_frames(background, process, file, tmp_path, network):
    fast = file.with_name("fast.pnfarm.yml")
    fast.write_text(FARM.replace("16ms", "1ms").replace("model: akd", "limits: lax\n    model: akd").replace(
        "factor: 20", "factor: 200"))  # fmt: skip
    up = background(
        "up", fast, "--pcap", tmp_path / "ring.pcapng", "--pcap-only", "cyclic", "--pcap-size", "1MB",
        "--pcap-files", "2",
    )  # fmt: skip
    up.wait_for("farm started")
    assert process("plc", fast, "--seconds", "8").code == 0
    assert up.stop(signal.SIGTERM) == 0
    first, second = sorted(tmp_path.glob("ring_*.pcapng"))
    assert int(first.name.split("_")[1]) + 1 == int(second.name.split("_")[1]) >= 3
    channels: set[bytes] = set()
    for path in (first, second):
        assert path.stat().st_size <= 1_000_000
        with RawPcapNgReader(str(path)) as reader:
            for data, _ in reader:
                assert is_cyclic(data)
                channels.add(data[:12])
    assert len(channels) == 6
    lost = json.loads(re.findall(r".*capture ended.*", up.err + up.out)[-1])["lost"]
    assert lost == 0


def test_what_a_station_says_is_one_line_and_cannot_control_the_terminal(pnfarm, tmp_path):
    name = NameBlock("axis\x1b[2J\n-1")
    pdu = emit_dcp(DcpPdu(DCP_IDENTIFY_RESPONSE, SERVICE_IDENTIFY, TYPE_SUCCESS, 7, (name,)))
    path = tmp_path / "line.pcapng"
    write_frames(path, [(bytes.fromhex("020000000001 020000000002 8892") + pdu, 10**18)], "")
    done = pnfarm("decode", path)
    (line,) = done.out.splitlines()
    assert line.endswith("DCP Identify.res name axis?[2J?-1")


@pytest.mark.parametrize(
    ("farm", "device", "begin"),
    [
        ("weigher", "weigher", "12 octets, RPI 10 ms"),
        ("cell", "island", "40 octets, cycle 16 ms"),
        ("profibus-cell", "island", "8 octets; 00"),
    ],
)
def test_the_devices_of_a_farm_file_are_known_where_the_capture_begins_in_the_middle(
    pnfarm, tmp_path, farm, device, begin
):
    file, whole, rest = CONFIGS / f"{farm}.pnfarm.yml", tmp_path / "whole.pcapng", tmp_path / "rest.pcapng"
    record(parse_farm(file.read_text("utf-8"), file), whole, seconds=3.0 if farm == "weigher" else 0.2)
    frames = list(FrameReader(whole, [PROFIBUS_DL]))
    last = [(one.data, one.time_ns) for one in frames if one.time_ns > frames[-1].time_ns - 100_000_000]
    # an interface without a name, which says nothing of the stations
    write_frames(rest, last, "", frames[-1].link_type)
    found = pnfarm("decode", rest, "--farm", file, "--drive", device, "--only", "cyclic").out
    (line,) = [line for line in found.splitlines() if f"{device} -> plc cyclic data begin" in line]
    assert begin in line
    assert "layout unknown" not in found
