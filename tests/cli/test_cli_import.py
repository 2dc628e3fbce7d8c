"""``pnfarm import``: the farm file that a capture of a plant becomes."""

import random
from dataclasses import replace
from ipaddress import IPv4Address
from itertools import islice
from pathlib import Path

import pytest
import yaml
from cip_tape import IDS, MACS, MANAGER, Tape, connect, everything, forward_open
from gsdml_examples import ISLAND
from hypothesis import example, given, settings
from hypothesis import strategies as st
from imported import check_found
from recorded import record, write_frames

from pnfarm.buses import registry
from pnfarm.buses.ethernetip.bus import ETHERNETIP
from pnfarm.buses.imports import FoundDevice, FoundDrive, FoundStation, ImportingBus
from pnfarm.buses.projects.description_folders import DescriptionFile
from pnfarm.captures.reading import CapturedFrame, FrameReader
from pnfarm.farm.farm import model_of
from pnfarm.farm.file.found import write_farm
from pnfarm.farm.file.reading import expand, load_farm, parse_farm
from pnfarm.protocols.enip.connection_check import check_io, read_path
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire import forward_open as fo
from pnfarm.protocols.enip.wire.cpf import emit_items
from pnfarm.protocols.enip.wire.encapsulation import Command, EncapsulationPdu, emit_encapsulation
from pnfarm.protocols.enip.wire.epath import LogicalSegment, emit_epath, logical_path
from pnfarm.protocols.enip.wire.identity import IdentityItem
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.testing import Line
from tests.fuzz.mutate import mutated

#: A connection's path without an electronic key.
ANY = emit_epath(tuple(LogicalSegment(kind, value) for kind, value in ((0, 4), (1, 100), (3, 101), (3, 102))))
CAPTURES = Path(__file__).resolve().parents[3] / "shared" / "captures"
PLANT = """
farm: plant
link: {kind: memory}
drives:
  - {name: infeed, model: akd-profinet, ip: 10.77.0.11/24, gateway: 10.77.0.254}
  - {name: gripper, model: hiwin-e1, ip: 10.77.0.12/24, limits: lax}
  - {name: press, model: moog-msd, ip: 10.77.0.13/24, limits: lax, identity: {IDENTITY}}
  - {name: spare, model: hiwin-e1, ip: 10.77.0.14/24, limits: lax}
controller:
  name: plc
  ip: 10.77.0.1/24
  cycle: 16ms
"""
#: As a maker's own file could have it.
IDENTITY = (
    "{device: 0x456, dap: 0x77, dap_submodules: {1: 0x78, 0x8000: 0x79}, access_point: 0xFFFE, "
    "telegrams: {101: {module: 0x9065, submodule: 0x8065}}}"
)


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The start-up of a plant in virtual time, and the farm that made it."""
    file = tmp_path_factory.mktemp("plant") / "plant.pcapng"
    config = parse_farm(PLANT.replace("{IDENTITY}", "{}"))
    record(config, file, seconds=0.2)
    return file, config


def imported(pnfarm, file, *options):
    found = pnfarm("import", file, *options)
    assert (found.code, found.err) == (0, "")
    return found.out


def test_a_capture_becomes_a_farm_file_with_the_drives_as_they_were(pnfarm, capture):
    file, config = capture
    text = imported(pnfarm, file)
    made = {drive.name: drive for drive in expand(parse_farm(text))}
    for drive in expand(config):
        own = made[drive.name]
        assert (own.model, own.ip, own.mac, own.gateway) == (drive.model, drive.ip, drive.mac, drive.gateway)
        assert model_of(own).profidrive.identity == model_of(drive).profidrive.identity
    assert made["gripper"].strict is False
    assert made["infeed"].strict
    assert "# its cycle of 16 ms is not the manual's 4 ms and less: limits are lax" in text
    assert "# telegram 1 in slot 1" in text
    assert "connected by plc: cycle 16 ms, watchdog 3 cycles" in text.replace("\n  #  ", "")


def test_the_file_is_written_and_the_next_step_is_told(pnfarm, capture, tmp_path):
    file, _ = capture
    out = tmp_path / "line.pnfarm.yml"
    found = pnfarm("import", file, "-o", out, "--name", "line-7", "--parent", "enp3s0")
    assert (found.code, "next: pnfarm validate" in found.out) == (0, True)
    values = yaml.safe_load(out.read_text())
    assert (values["farm"], values["link"]) == ("line-7", {"kind": "macvlan", "parent": "enp3s0"})
    assert pnfarm("validate", out).code == 0
    again = pnfarm("import", file, "-o", out)
    assert (again.code, "--force" in again.err) == (2, True)
    assert pnfarm("import", file, "-o", out, "--force").code == 0


def test_a_capture_without_devices_is_refused(pnfarm, tmp_path):
    file = tmp_path / "nothing.pcap"
    file.write_bytes(bytes.fromhex("d4c3b2a1020004000000000000000000ffff000001000000"))
    found = pnfarm("import", file)
    assert (found.code, "shows no device" in found.err) == (2, True)
    assert pnfarm("import", tmp_path / "none.pcap").code == 2


@pytest.mark.parametrize(
    ("name", "words"),
    [("dacookie_connectrequest.pcap", ("io-devicexb15b32", "ET200SP", "cycle 2 ms", "15 start-up records")),
     ("drive_connect_api3a00.pcap", ("vendor 0x0080", "cycle 4 ms", "0x00000068 12/12")),
     ("pnio-rs_s7-1515_golden.pcap", ("rt-labs-dev", "172.16.2.10", "cycle 32 ms"))],
)  # fmt: skip
def test_devices_of_real_captures_are_listed_with_what_was_seen(pnfarm, name, words):
    if not (CAPTURES / name).exists():
        pytest.skip("the captures of real controllers are not here")
    text = " ".join(imported(pnfarm, CAPTURES / name).replace("#", " ").split())
    for word in words:
        assert word in text


def test_a_drive_under_other_idents_keeps_them_and_connects(pnfarm, tmp_path):
    # the vendor stays the same, by which a drive of an unknown device number is told
    text = PLANT.replace("{IDENTITY}", IDENTITY).replace("cycle: 16ms", "cycle: 16ms\n  telegram: 101")
    config = parse_farm("\n".join(line for line in text.splitlines() if "infeed" not in line and "hiwin" not in line))
    file = tmp_path / "plant.pcapng"
    record(config, file)
    text = imported(pnfarm, file)
    (made,) = [drive for drive in expand(parse_farm(text)) if drive.name == "press"]
    assert made.model == "moog-msd"
    own = model_of(made)
    assert (own.profidrive.identity.device_id, own.dap.ident) == (0x456, 0x77)
    assert own.profidrive.telegrams[101].module.ident == 0x9065
    assert [one.ident for one in own.profidrive.telegrams[101].module.submodules] == [0xFFFE, 0x8065]
    here = text.replace("{kind: macvlan, parent: eth1}", "{kind: memory}").replace("api: 127.0.0.1:8702\n", "")
    with Line.from_text(here + "controller: {name: plc, ip: 10.77.0.1/24, cycle: 16ms}\n") as line:
        line.wait_connected(5)


# -- EtherNet/IP -----------------------------------------------------------------------------------------------------


def taped(folder, item=None, asked=None, refusal=None):
    """A capture of one originator and one adapter, which says who it is and is connected."""
    tape = Tape()
    if item is not None:
        answer = EncapsulationPdu(Command.LIST_IDENTITY, emit_items((item,)))
        tape.udp(1, emit_encapsulation(answer), (44818, 50_000))
    if refusal is not None:
        tape.ask(message_request(Service.FORWARD_OPEN, MANAGER, fo.emit_forward_open(asked)))
        tape.answer(Service.FORWARD_OPEN, fo.ForwardRefusal(asked.triad).emit(), 1, refusal)
    elif asked is not None:
        connect(tape, asked)
    return written(tape, folder)


def written(tape, folder):
    """The frames as a file."""
    return write_frames(folder / "cell.pcapng", zip(tape.frames, tape.times, strict=True))


def adapter(vendor=452, product=1, name=b"AKD", revision=(1, 13)):
    return IdentityItem(IPv4Address("10.77.0.11"), vendor, 16, product, revision, 0x30, 0x1234, name, 3)


def plain(text):
    return " ".join(text.replace("#", " ").split())


def test_an_adapter_of_a_capture_becomes_a_drive_that_the_same_scanner_connects(pnfarm, tmp_path):
    rpi = {"o_to_t_rpi_us": 20_000, "t_to_o_rpi_us": 20_000}
    text = imported(pnfarm, taped(tmp_path, adapter(), forward_open(**rpi)))
    (drive,) = expand(parse_farm(text))
    assert (drive.model, drive.name, str(drive.ip)) == ("akd-ethernetip", "drive-0-11", "10.77.0.11/24")
    assert (drive.mac, drive.rpi_ns, drive.strict) == (MACS[1], 20_000_000, True)
    assert drive.identity == {}
    assert "/24 is assumed" in plain(text)
    assert "connected by 10.77.0.1: 70 octets to it every 20 ms, 66 from it every 20 ms" in plain(text)
    assert "assemblies 101 and 102" in plain(text)
    here = text.replace("{kind: macvlan, parent: eth1}", "{kind: memory}").replace("api: 127.0.0.1:8702\n", "")
    with Line.from_text(here + "controller: {name: plc, ip: 10.77.0.1/24}\n") as line:
        line.wait_connected(5)


def test_an_adapter_under_another_product_code_keeps_its_identity(pnfarm, tmp_path):
    fast = {"o_to_t_rpi_us": 2_000, "t_to_o_rpi_us": 2_000}
    text = imported(pnfarm, taped(tmp_path, adapter(product=44, name=b"AKD 2G", revision=(2, 1)), forward_open(**fast)))
    (drive,) = expand(parse_farm(text))
    assert drive.model == "akd-ethernetip"
    facts = model_of(drive).bus_facts
    assert (facts["product_code"].value, facts["product_name"].value) == (44, "AKD 2G")
    assert tuple(facts["revision"].value) == (2, 1)
    assert drive.strict is False
    assert "chosen by its vendor: no model has product code 44" in plain(text)
    assert "shorter than the manual's" in plain(text)


def test_an_adapter_is_told_by_the_key_of_its_connection_alone(pnfarm, tmp_path):
    (drive,) = expand(parse_farm(imported(pnfarm, taped(tmp_path, None, forward_open()))))
    assert (drive.model, drive.rpi_ns) == ("akd-ethernetip", 10_000_000)


def test_a_refused_connection_and_why_are_told(pnfarm, tmp_path):
    text = imported(pnfarm, taped(tmp_path, adapter(), forward_open(), refusal=(0x0114,)))
    assert "its connection was refused in the capture" in plain(text)
    assert "0x0114" in text or "product code" in text


def test_each_of_two_connections_opened_at_once_has_its_own_answer(pnfarm, tmp_path):
    tape = Tape()
    asked = forward_open(t_to_o=fo.NetworkParameters(10)), forward_open(triad=fo.Triad(8, 0x1234, 0x5678))
    for one in asked:
        tape.ask(message_request(Service.FORWARD_OPEN, MANAGER, fo.emit_forward_open(one)))
    tape.answer(Service.FORWARD_OPEN, fo.ForwardRefusal(asked[0].triad).emit(), 1, (0x0117,))
    tape.answer(Service.FORWARD_OPEN, fo.ForwardOpenReply(*IDS, asked[1].triad, 10_000, 10_000).emit())
    text = plain(imported(pnfarm, written(tape, tmp_path)))
    assert "also connected by 10.77.0.1: 70 octets to it every 10 ms, 10 from it" in text
    assert text.count("refused: ") == 1


def test_an_adapter_of_another_vendor_is_listed(pnfarm, tmp_path):
    text = imported(pnfarm, taped(tmp_path, adapter(vendor=7, name=b"Gripper"), forward_open(path=ANY)))
    assert yaml.safe_load(text).get("drives") is None
    assert "Gripper" in plain(text)
    assert "vendor 7" in plain(text)


def device_of(pnfarm, file, folder):
    """The farm file that a capture of one adapter becomes, in memory."""
    out = folder / "made.pnfarm.yml"
    found = pnfarm("import", file, "-o", out)
    assert (found.code, found.err) == (0, "")
    text = out.read_text().replace("{kind: macvlan, parent: eth1}", "{kind: memory}").replace("api: 127.0.0.1:8702", "")
    out.write_text(text + "controller: {name: plc, ip: 10.77.0.1/24}\n")
    return out


@pytest.mark.parametrize(
    "asked",
    [
        {"o_to_t": fo.NetworkParameters(2 + 4 + 10), "t_to_o": fo.NetworkParameters(2 + 24)},
        {"o_to_t": fo.NetworkParameters(2), "t_to_o": fo.NetworkParameters(2 + 8)},
        {"o_to_t": fo.NetworkParameters(2 + 4 + 1, variable=True), "t_to_o": fo.NetworkParameters(2, variable=True)},
    ],
)
def test_an_adapter_that_no_model_fits_is_a_device_that_takes_the_captured_forward_open(pnfarm, tmp_path, asked):
    request = forward_open(path=ANY, t_to_o_rpi_us=20_000, o_to_t_rpi_us=20_000, **asked)
    file = taped(tmp_path, adapter(vendor=7, name=b"Gripper", revision=(3, 4)), request)
    out = device_of(pnfarm, file, tmp_path)
    (group,) = load_farm(out).devices
    assert (str(group.ip), group.rpi_ns) == ("10.77.0.11/24", 20_000_000)
    with Line.from_file(out) as line:
        kind = line.core.device("device-0-11").device.kind
        key = kind.described.sheet.key
        assert (key.vendor_id, key.device_type, key.product_code, key.major_revision) == (7, 16, 1, 3)
        check_io(request, read_path(request.path), kind.settings(key, IPv4Address("239.0.0.1")))
        line.wait_connected(5)
        assert line.core.device("device-0-11").device.connection().exchanging


def test_an_adapter_with_a_connection_to_no_assembly_is_listed_with_why(pnfarm, tmp_path):
    path = emit_epath(logical_path(0x67, 1))
    text = imported(pnfarm, taped(tmp_path, adapter(vendor=7, name=b"Gripper"), forward_open(path=path)))
    assert "Gripper: no device can be made of its connection: its path names no assemblies of its own" in plain(text)


def test_an_adapter_of_the_vendor_with_other_sizes_is_no_drive(pnfarm, tmp_path):
    asked = forward_open(t_to_o=fo.NetworkParameters(10), path=ANY)
    text = imported(pnfarm, taped(tmp_path, adapter(product=9, name=b"Gateway"), asked))
    assert yaml.safe_load(text).get("drives") is None


@settings(max_examples=150, deadline=None)
@given(st.lists(st.integers(0, 2**32), min_size=20, max_size=60))
# a ListIdentity with revision 255.13: CIP has seven bits for the first number
@example([0] * 22 + [304378675])
def test_whatever_is_in_a_capture_the_farm_file_can_be_read(seeds):
    decoder = registry.decoder()
    ETHERNETIP.observe(decoder.buses["ethernetip"])
    frames = everything()
    pool = [one[34:] for one in frames]
    for number, seed in enumerate(seeds):
        frame = frames[number % len(frames)]
        if seed % 2:
            # behind the addresses, so that it reaches the decoder
            frame = frame[:34] + mutated(random.Random(seed), frame[34:], pool)
        decoder.feed(CapturedFrame(number + 1, 10**18 + number, frame))
    check_found(ETHERNETIP.found(decoder.buses["ethernetip"]))


def test_what_a_farm_cannot_play_is_left_out_and_reported(pnfarm, tmp_path):
    file = taped(tmp_path, adapter(product=44, name=b"AKD 2G", revision=(255, 13)), forward_open())
    found = pnfarm("import", file)
    (drive,) = expand(parse_farm(found.out))
    assert model_of(drive).bus_facts["product_code"].value == 44
    assert "left out: identity.revision '255.13'" in plain(found.out)
    assert "identity.revision '255.13'" in found.err


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_whatever_is_in_a_plants_capture_the_farm_file_can_be_read(capture, data):
    file, _ = capture
    decoder = registry.decoder()
    buses = [bus for bus in registry.BUSES.values() if isinstance(bus, ImportingBus)]
    for bus in buses:
        bus.observe(decoder.buses[bus.name])
    # what sets up a connection comes first; cyclic frames say nothing more
    frames = list(islice(FrameReader(file, decoder.link_types), 400))
    pool = [frame.data[14:] for frame in frames]
    chosen = random.Random(data.draw(st.integers(0, 2**32)))
    for frame in frames:
        octets = frame.data
        if chosen.random() < 0.3:
            octets = octets[:14] + mutated(chosen, octets[14:], pool)
        decoder.feed(replace(frame, data=octets))
    models = data.draw(st.booleans())
    check_found([one for bus in buses for one in bus.found(decoder.buses[bus.name], models=models)])


_TEXTS = st.text(max_size=80) | st.sampled_from(
    ["axis-1", "AXIS 1", "x" * 300, "a.b..c", "-", "a\x85b: c", "\u2028drives:", "{n}", "*", "'", '"', "# no", "\ud800"]
)
_NUMBERS = st.integers(-5, 5) | st.integers(0, 2**40)
_KEYS = st.fixed_dictionaries(
    {},
    optional={
        "ip": _TEXTS | st.sampled_from(["10.0.0.1/24", "10.0.0.1/24", "10.0.0.255/24", "0.0.0.0/0", "10.0.0.2/31"]),
        "gateway": _TEXTS | st.sampled_from(["10.0.0.254", "10.0.0.1"]),
        "mac": _TEXTS | st.sampled_from(["02:00:00:00:00:01", "ff:ff:ff:ff:ff:ff", "00:00:00:00:00:00"]),
        "identity": st.dictionaries(
            st.sampled_from(["vendor", "device", "dap", "station_type", "revision", "product_name", "gsdml", "other"])
            | _TEXTS,
            _NUMBERS | _TEXTS,
            max_size=4,
        )
        | st.dictionaries(st.just("telegrams"), st.dictionaries(_NUMBERS, st.dictionaries(_TEXTS, _NUMBERS))),
        "telegram": _NUMBERS,
        "address": _NUMBERS,
        "rpi": _TEXTS,
        "limits": _TEXTS | st.just("lax"),
    },
)
_STATION = st.builds(FoundStation, name=_TEXTS, facts=st.lists(_TEXTS, max_size=2).map(tuple))
_FILES = st.builds(
    DescriptionFile,
    st.just("gsdml"),
    st.just("GSDML-V2.35-pnfarm-{name}-20260101.xml"),
    st.sampled_from([ISLAND.read_bytes(), b"", b"<a/>"]),
)
_DEVICE = st.builds(
    FoundDevice,
    name=_TEXTS,
    file=_FILES,
    keys=st.fixed_dictionaries({"access_point": st.just("DAP 1") | _TEXTS}, optional={
        "slots": st.dictionaries(_NUMBERS, st.none() | _NUMBERS | st.just("16DI"), max_size=3),
        "ip": _TEXTS, "cycle": _TEXTS, "limits": _TEXTS,
    }),
    notes=st.lists(_TEXTS, max_size=2).map(tuple),
)  # fmt: skip
_FOUND = st.builds(
    FoundDrive,
    name=_TEXTS,
    model=st.sampled_from(["akd-profinet", "hiwin-e1", "akd-ethernetip", "moog-msd-dp"]),
    keys=_KEYS,
    notes=st.lists(_TEXTS, max_size=2).map(tuple),
)


@settings(max_examples=150, deadline=None)
@given(st.lists(_FOUND | _DEVICE | _STATION, max_size=5))
def test_whatever_was_found_the_farm_file_can_be_read(found):
    check_found([replace(one, line="profibus") if getattr(one, "model", "") == "moog-msd-dp" else one for one in found])


def test_thousands_of_stations_make_a_file_that_can_be_read():
    drives = [FoundDrive(f"axis-{n}", "akd-profinet", {"ip": f"10.0.{n // 250}.{n % 250 + 1}/16"}) for n in range(300)]
    others = [FoundStation(f"station {n}", ("x" * 5000,)) for n in range(5000)]
    made = check_found([*drives, *others])
    assert len(made.drives) == 300
    assert "and 4500 more" in made.text


def test_a_description_file_that_cannot_be_read_is_named_as_it_would_be_beside_the_farm_file(tmp_path):
    file = DescriptionFile("gsdml", "GSDML-V2.35-pnfarm-{name}-20260101.xml", b"")
    made = write_farm([FoundDevice("island", file, {})], "line", "eth1", "line.pcapng", tmp_path)
    (told,) = made.left_out
    assert told.startswith("island: cannot be in a farm: GSDML-V2.35-pnfarm-island-20260101.xml, line 1: no element")
    assert "GSDML-V2.35-pnfarm-island-20260101.xml" in made.text
