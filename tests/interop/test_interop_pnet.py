"""p-net's sample application (RT-Labs, C) as a device of the built-in controller, by its maker's GSDML file alone.

Collected only where ``PNFARM_PNET`` names its program ``pn_dev``; ``PNFARM_PNET_GSDML`` names its GSDML file.
"""

import json
import time

import pytest
from interop_rig import Capture, Worker
from pnet_device import GSDML, NAME, PnetDevice, here
from tools import needed
from waiting import until

FILE = """
controller:
  name: plc
  interface: plc0
  ip: 10.77.3.201/22
  cycle: 16ms
  watchdog_factor: 20
  reconnect: {{after: 500ms}}
  devices:
    - name: {name}
      gsdml: {gsdml}
      ip: 10.77.0.50/22
      modules: {{1: IDM_32, 2: IDM_40}}
"""
#: Octets of the input frame before slot 1: the provider status of three submodules of the access point.
FIRST_INPUT = 3

pytestmark = here


@pytest.fixture(scope="module")
def device(lab, tmp_path_factory):
    made = PnetDevice(lab, tmp_path_factory.mktemp("pnet"))
    try:
        yield made
    finally:
        made.close()


@pytest.fixture(scope="module")
def capture(lab, tmp_path_factory):
    """From before the first Connect, so that Wireshark knows what the frames hold."""
    needed("tshark", "dumpcap")
    with Capture(lab, tmp_path_factory.mktemp("capture") / "pnet.pcapng") as running:
        yield running


@pytest.fixture(scope="module")
def plc(lab, device, capture, tmp_path_factory):
    path = tmp_path_factory.mktemp("plc") / "pnet.pnfarm.yml"
    path.write_text(FILE.format(name=NAME, gsdml=json.dumps(str(GSDML.resolve()))), encoding="utf-8")
    worker = Worker(lab, "peer", "plc", path)
    try:
        assert worker.ask("wait_connected", seconds=20), worker.ask("summary")
        yield worker
    finally:
        worker.close()


def row_of(plc):
    (row,) = plc.ask("summary")
    return row


def alarms(plc):
    return [entry["detail"] for entry in plc.ask("events", name=NAME) if entry["event"] == "alarm"]


def losses(plc):
    return [entry["reason"] for entry in plc.ask("events", name=NAME) if entry["event"] == "connection lost"]


def read(plc, slot, subslot, index, length=4096):
    answer = plc.ask("read", name=NAME, api=0, slot=slot, subslot=subslot, index=index, length=length)
    assert answer["status"] == 0, answer
    return bytes.fromhex(answer["data"])


def test_it_is_found_addressed_and_exchanges_data(plc):
    row = row_of(plc)
    assert (row["state"], row["ip"], row["losses"]) == ("DATA", "10.77.0.50", 0)
    assert row["model"] == "P-Net multi-module sample app"
    assert "module differs" not in [entry["event"] for entry in plc.ask("events", name=NAME)]


def test_the_parameters_of_its_file_were_written(plc):
    written = [read(plc, 1, 1, 123), read(plc, 1, 1, 124), read(plc, 2, 1, 125)]
    assert [int.from_bytes(octets, "big") for octets in written] == [1, 2, 2]


def test_its_records_are_read_and_its_refusals_told_in_words(plc):
    im0 = read(plc, 0, 1, 0xAFF0)
    assert (im0[6:8].hex(), im0[8:28]) == ("0493", b"12345 Abcdefghijk   ")
    im1 = bytes.fromhex("002100380100") + b"press 4".ljust(32) + b"hall 2".ljust(22)
    assert plc.ask("write", name=NAME, api=0, slot=0, subslot=1, index=0xAFF1, data=im1.hex())["status"] == 0
    assert read(plc, 0, 1, 0xAFF1) == im1
    refused = plc.ask("read", name=NAME, api=0, slot=1, subslot=1, index=77)
    assert refused["status"] == 0xDE80A000
    nothing = plc.ask("read", name=NAME, api=0x3A00, slot=1, subslot=1, index=123)
    assert nothing["reason"] == "the answer has no readable PNIOStatus"


def test_outputs_reach_it_and_its_inputs_reach_us(plc, device, capture):
    assert not device.lamp(1)
    plc.ask("outputs", name=NAME, slot=1, subslot=1, data="80")
    assert until(lambda: device.lamp(1), 5)
    # a float and an integer, which it multiplies by the gain that its file's parameter sets: 2
    plc.ask("outputs", name=NAME, slot=2, subslot=1, data="3fc000000000000b")
    device.button("1", pressed=True)
    time.sleep(0.5)
    device.button("1", pressed=False)
    plc.ask("outputs", name=NAME, slot=1, subslot=1, data="00")
    assert until(lambda: not device.lamp(1), 5)
    inputs = inputs_of(capture)
    assert bytes.fromhex("4040000000000016") in {octets[2:10] for octets in inputs}
    counted = {octets[0] & 0x7F for octets in inputs}
    assert len(counted) > 3, "its counter stands still"
    assert {octets[0] >> 7 for octets in inputs} == {0, 1}, "its button is not seen"


def inputs_of(capture):
    """What stood at the inputs of its two modules: an octet, its status, eight octets, their status."""
    from scapy.all import Ether, PcapNgReader

    time.sleep(0.3)  # dumpcap writes in blocks
    found = []
    with PcapNgReader(str(capture.path)) as frames:
        for frame in frames:
            octets = bytes(frame[Ether])[12:]
            octets = octets[4:] if octets[:2] == b"\x81\x00" else octets
            if octets[:4] == b"\x88\x92\x80\x00":
                found.append(octets[4 + FIRST_INPUT :])
    return found


def press_until(device, condition):
    """Its second button goes through what it can raise, one after the other; a press can get lost on a busy machine."""
    for _ in range(30):
        device.press("2")
        end = time.monotonic() + 0.6
        while time.monotonic() < end:
            if condition():
                return
            time.sleep(0.02)
    raise AssertionError("it did not come about")


def test_its_alarms_are_acknowledged_and_told_in_words(plc, device):
    """Without an AlarmAck it would raise no other."""
    assert plc.ask("wait_connected", seconds=10)
    press_until(device, lambda: "process alarm on slot 1 subslot 0x0001: USI 0x0010 01" in alarms(plc))
    appears = "diagnosis appears on slot 1 subslot 0x0001: channel 4 short circuit (fault, appears)"
    press_until(device, lambda: appears in alarms(plc))
    assert b"\x80\x02\x00\x04\x28\x01" in read(plc, 1, 1, 0x800C), "the diagnosis is not in its record"
    press_until(device, lambda: any(words.endswith("all gone)") for words in alarms(plc)))
    assert read(plc, 1, 1, 0x800C) == b""


def test_it_is_lost_and_found_again(plc, device):
    """A log book entry, and then it ends the connection."""
    by_device = "the device aborts: RTA error: RTA_ERR_CLS_PROTOCOL: code 0"
    press_until(device, lambda: any(words.startswith(by_device) for words in losses(plc)))
    assert plc.ask("wait_connected", seconds=10)
    before = row_of(plc)["expirations"]
    device.stop_for(1.0)
    plc.until(lambda rows: rows[0]["expirations"] > before, "summary")
    assert "no input data within the data hold time" in losses(plc)
    assert plc.ask("wait_connected", seconds=10)


def test_each_end_knows_the_other_by_lldp(plc):
    """PDPortDataReal names its peer, and the controller noted its own."""
    plc.until(lambda entries: "neighbour appeared" in [entry["event"] for entry in entries], "events", name="plc")
    seen = [entry for entry in plc.ask("events", name="plc") if entry["event"] == "neighbour appeared"]
    assert (seen[0]["neighbour"], seen[0]["neighbour_port"]) == (NAME, "port-001")
    assert until(lambda: b"\x08port-001\x03plc" in read(plc, 0, 0x8001, 0x802A), 12)


def test_it_is_released(plc):
    assert plc.ask("release")
    assert "released" in [entry["event"] for entry in plc.ask("events", name=NAME)]
    assert row_of(plc)["state"] == "STOPPED"


def test_a_submodule_that_it_does_not_know_is_told_by_its_sentence(lab, plc, tmp_path):
    """After the release: the device has room for one connection."""
    del plc
    file = tmp_path / "bent.xml"
    file.write_bytes(GSDML.read_bytes().replace(b'SubmoduleIdentNumber="0x0132"', b'SubmoduleIdentNumber="0x0999"'))
    text = FILE.format(name=NAME, gsdml=json.dumps(str(file))).replace("name: plc", "name: second")
    (tmp_path / "second.pnfarm.yml").write_text(text, encoding="utf-8")
    second = Worker(lab, "peer", "plc", tmp_path / "second.pnfarm.yml")
    try:
        assert second.ask("wait_connected", seconds=20), second.ask("summary")
        told = [entry["detail"] for entry in second.ask("events", name=NAME) if entry["event"] == "module differs"]
        assert told == ["slot 1 subslot 0x0001: wrong submodule, device has 0x00000999"]
    finally:
        second.close()


def test_wireshark_finds_nothing_wrong_with_our_frames(plc, capture):
    """The last test of this file: it looks at all the others."""
    del plc
    time.sleep(0.5)
    (mac,) = {row[0] for row in capture.fields("eth.src", where="pn_io.opnum==0 && dcerpc.pkt_type==0")}
    assert len(capture.fields("frame.number", where=f"eth.src=={mac}")) > 100
    ours = f"eth.src=={mac} && (_ws.malformed || _ws.expert)"
    assert capture.fields("frame.number", "_ws.expert.message", where=ours) == []
