"""All that a farm and the built-in controller say, in the eyes of Wireshark: nothing malformed, no warning."""

import itertools
import statistics
import sys
import time
from collections import Counter

import pytest
from interop_rig import HERE, Capture, running, tshark_fields, tshark_tree
from tools import needed

from pnfarm.protocols.profinet.wire.records.fsu import FsHello, FsuDataAdjust

DRIVES = ["{name: 'axis-{n:02}', count: 3, model: akd-profinet, ip: 10.77.0.11/22, limits: lax, hello: true}"]
PLC_MAC = "02:00:00:00:fa:01"
CONTROLLER = """
controller:
  name: plc
  ip: 10.77.3.250/22
  mac: {mac}
  link: {{kind: macvlan, parent: plc0}}
  cycle: 4ms
  watchdog_factor: {watchdog}
  startup: {startup}
  program: {{kind: sine, speed_rpm: 300, period: 1s, acknowledge_after: 100ms}}
  reconnect: {{after: 200ms}}
"""
#: PF_EXPERT severities of Wireshark: note 0x400000, warning 0x600000, error 0x800000.
WARNING = 0x600000
BASE_MODE = 47
#: Base mode: request 1, read, axis 0, one parameter; its value, five elements of PNU 964 from 0.
READ_964 = "01010001 1005 03c4 0000".replace(" ", "")


def controller(lab, folder, startup, watchdog=50):
    rest = CONTROLLER.format(mac=PLC_MAC, startup=startup, watchdog=watchdog)
    return running(lab, folder, DRIVES, rest=rest, kind="plc", where="peer")


def raw(lab, *arguments):
    return lab.peer_json("peer_raw.py", *arguments)


def records(plc):
    """Good and bad record accesses beside the cyclic data."""
    assert plc.ask("write", name="axis-01", index=BASE_MODE, data=READ_964)["status"] == 0
    answer = plc.ask("read", name="axis-01", index=BASE_MODE)
    assert answer["data"].startswith("01010001"), answer
    assert plc.ask("read", name="axis-01", index=0xAFF0, api=0, slot=0)["status"] == 0
    plc.ask("read_implicit", name="axis-01", index=0xAFF0)
    for index in (0xAFF1, 0xF000, 0xF830, 0xE000, 0xE040, 0x8028, 0x8029, 0xC000, 0x1234):
        for api, slot, subslot in ((0, 0, 1), (0x3A00, 1, 2)):
            plc.ask("read", name="axis-01", index=index, api=api, slot=slot, subslot=subslot)
    plc.ask("write", name="axis-01", index=0xAFF1, api=0, slot=0, data="002100380100" + "41" * 54)
    plc.ask("write", name="axis-01", index=0x1234, data="00")
    hello = FsuDataAdjust((FsHello(1, 50, 2, 0),)).emit().hex()
    assert plc.ask("write", name="axis-01", index=0x8090, api=0, slot=0, subslot=0x8000, data=hello)["status"] == 0
    # no such parameter; a change that is refused; a description; a text; two parameters, one of them wrong
    for data in (
        "010100011001ffff0000", "0201000120000 3c40000", "0301000110000 3c40000", "0402000110010 3c40000 42010001",
        "05010002 100103c40000 1001ffff0000",
    ):  # fmt: skip
        octets = data.replace(" ", "")
        plc.ask("write", name="axis-01", index=BASE_MODE, data=octets)
        plc.ask("read", name="axis-01", index=BASE_MODE)


def all_run(plc):
    assert plc.ask("wait_connected", seconds=15)
    assert plc.ask("wait_running", seconds=15), plc.ask("summary")


@pytest.fixture(scope="module")
def seen(lab, tmp_path_factory):
    """A capture of everything that a farm and a controller can do in half a minute."""
    needed("tshark", "dumpcap", "ping")
    folder = tmp_path_factory.mktemp("seen")
    with Capture(lab, folder / "all.pcapng") as capture, running(lab, folder, DRIVES) as farm:
        macs = [drive["mac"] for drive in farm.ask("drives")]
        lab.run("peer", "ping", "-c", 2, "-i", 0.02, "-s", 1400, "10.77.0.11")
        lab.run("peer", "ping", "-c", 1, "-s", 4000, "10.77.0.12")
        raw(lab, "arp", "10.77.0.13")
        raw(lab, "lookup", "10.77.0.11")
        raw(lab, "rpc", "10.77.0.11")
        for startup in ("legacy", "advanced"):
            with controller(lab, folder, startup) as plc:
                all_run(plc)
                records(plc)
                farm.ask("fault", name="axis-02", number=702)
                time.sleep(0.5)
                farm.ask("abort", name="axis-03", reason=5)
                farm.ask("power", name="axis-02", on=False)  # silence: the controller's data hold timer runs out
                time.sleep(0.6)
                farm.ask("power", name="axis-02", on=True)
                all_run(plc)
                with plc.stopped():  # silence of the controller: the drives' data hold timers run out
                    time.sleep(0.6)
                all_run(plc)
        # 0x80: not used, because another has it
        assert raw(lab, "conflict", macs[2], "10.77.0.11") == 0x80
        view = farm.ask("controller", name="axis-01")
        # last, because it leaves the drives without names and addresses
        lab.run("peer", sys.executable, HERE / "peer_raw.py", "dcp", *macs)
    return capture, {*macs, PLC_MAC}, set(macs), (macs[0], view)


def of(macs):
    return "(" + " || ".join(f"eth.src=={mac}" for mac in sorted(macs)) + ")"


def test_no_frame_is_malformed_or_worth_a_warning(seen):
    capture, ours, _, _ = seen
    rows = capture.fields(
        "frame.number", "_ws.malformed", "_ws.expert.severity", "_ws.expert.message", "_ws.col.Info",
        where=f"{of(ours)} && (_ws.malformed || _ws.expert)",
    )  # fmt: skip
    bad = [row for row in rows if row[1] or any(int(s) >= WARNING for s in row[2].split(",") if s)]
    kinds = Counter((row[1], row[3], row[4].split(",")[0]) for row in bad)
    first = tshark_tree(capture.path, bad[0][0]) if bad else ""
    assert not bad, f"{len(bad)} frames, such as {kinds.most_common(8)}; the first:\n{first}"


def test_nothing_of_a_pdu_is_left_undissected(seen):
    capture, ours, _, _ = seen
    rows = capture.fields(
        "frame.number", "_ws.col.Info", where=f"{of(ours)} && (data || (vlan.trailer && !pn_rt) || _ws.short)"
    )
    # echo requests carry what the peer put in; a datagram's fragments show as data until they are whole
    rows = [row for row in rows if "Echo" not in row[1] and "Fragmented" not in row[1]]
    assert not rows, rows[:10]


def test_the_capture_holds_frames_of_every_kind(seen):
    """The two tests above say something only if all was there to be seen."""
    capture, _ours, macs, _ = seen
    kinds = {
        "identify answers": "pn_dcp.service_id==5 && pn_dcp.service_type==1",
        "get answers": "pn_dcp.service_id==3 && pn_dcp.service_type==1",
        "set answers": "pn_dcp.service_id==4 && pn_dcp.service_type==1",
        "block errors": "pn_dcp.block_error>0",
        "hellos": "pn_dcp.service_id==6",
        "address conflicts": "pn_dcp.suboption_ip_block_info==0x80",
        "arp probes": "arp.opcode==1 && arp.src.proto_ipv4==0.0.0.0",
        "cyclic frames": "pn_rt.ds && pn_rt.frame_id<0xfc00",
        "connect answers": "pn_io.opnum==0 && dcerpc.pkt_type==2",
        "release answers": "pn_io.opnum==1 && dcerpc.pkt_type==2",
        "read answers": "pn_io.opnum==2 && dcerpc.pkt_type==2",
        "write answers": "pn_io.opnum==3 && dcerpc.pkt_type==2",
        "control answers": "pn_io.opnum==4 && dcerpc.pkt_type==2",
        "implicit read answers": "pn_io.opnum==5 && dcerpc.pkt_type==2",
        "application ready": "pn_io.block_type==0x0112",
        "identification": "pn_io.block_type==0x0020",
        "module diffs or real identification": "pn_io.block_type==0x0013",
        "endpoint mapper": "epm && dcerpc.pkt_type==2",
        "rejects": "dcerpc.pkt_type==6",
        "nocalls": "dcerpc.pkt_type==5",
        "errors on the alarm channel": "pn_rt.frame_id==0xfe01",
        "arp replies": "arp.opcode==2",
        "arp requests": "arp.opcode==1",
        "echo replies": "icmp.type==0",
    }
    missing = [
        name for name, what in kinds.items() if not capture.fields("frame.number", where=f"{of(macs)} && ({what})")
    ]
    assert not missing
    for what in (
        "pn_dcp.service_id==5 && pn_dcp.service_type==0",
        "pn_io.opnum==0",
        "pn_io.opnum==1",
        "pn_rt.ds",
        "pn_rt.frame_id==0xfe01",
    ):
        assert capture.fields("frame.number", where=f"eth.src=={PLC_MAC} && ({what})"), what


def test_a_drive_uses_no_address_but_its_own(seen):
    capture, _, macs, _ = seen
    rows = capture.fields(
        "eth.src", "ip.src", "arp.src.hw_mac", "arp.src.proto_ipv4", where=f"{of(macs)} && (ip || arp)"
    )
    spoken = {(row[0], row[1] or row[3]) for row in rows if (row[1] or row[3]) != "0.0.0.0"}
    assert all(row[2] in {"", row[0]} for row in rows)
    assert len(spoken) == len(macs), spoken


def test_the_cyclic_frames_of_a_drive_keep_their_counter_and_cycle(seen):
    capture, _, macs, _ = seen
    for mac in macs:
        rows = tshark_fields(
            capture.path,
            "frame.time_relative",
            "pn_rt.cycle_counter",
            where=f"eth.src=={mac} && pn_rt.ds && pn_rt.frame_id<0xfc00",
        )
        steps = Counter((int(b[1]) - int(a[1])) & 0xFFFF for a, b in itertools.pairwise(rows))
        # 4 ms are 128 units of 31.25 us; other steps where a connection ended and another began, or the machine stalled
        assert steps[128] > 0.9 * len(rows), steps.most_common(4)


def test_the_controllers_punctuality_is_that_of_the_capture(seen):
    capture, _, _, (mac, view) = seen
    rows = capture.fields(
        "frame.time_epoch", where=f"eth.src=={PLC_MAC} && eth.dst=={mac} && pn_rt.ds && pn_rt.frame_id<0xfc00"
    )
    times = [float(row[0]) for row in rows]
    # longer than the watchdog: another connection
    gaps = [gap for gap in (b - a for a, b in itertools.pairwise(times)) if gap < 0.2]
    counted = sum(bucket["count"] for bucket in view["intervals"]["buckets"])
    assert counted == sum(bucket["count"] for bucket in view["jitter"]["buckets"])
    assert counted == pytest.approx(len(gaps), rel=0.01)
    assert view["intervals"]["mean_seconds"] == pytest.approx(sum(gaps) / len(gaps), rel=0.01)
    deviations = [abs(gap - max(1, round(gap / 0.004)) * 0.004) for gap in gaps]
    # the capture's time stamps are of the cable's other end
    assert view["jitter"]["mean_seconds"] == pytest.approx(sum(deviations) / len(deviations), rel=0.25, abs=50e-6)
    for edge in (0.0002, 0.001):
        within = sum(
            bucket["count"] for bucket in view["jitter"]["buckets"] if (bucket["up_to_seconds"] or 1e9) <= edge
        )
        assert within / counted == pytest.approx(sum(d <= edge for d in deviations) / len(gaps), abs=0.05)


def test_the_phases_of_a_start_up_are_those_of_the_capture(seen):
    capture, _, _, (mac, view) = seen
    rows = capture.fields(
        "frame.time_epoch", "eth.src", "pn_io.opnum",
        where=f"eth.addr=={mac} && dcerpc.pkt_type==2 && (pn_io.opnum==0 || pn_io.opnum==4)",
    )  # fmt: skip
    found, answers = [], []
    for seconds, source, operation in rows:
        if operation == "0":
            # the drive's answer to Connect, to the end of parameters, and the controller's to ApplicationReady
            answers = [float(seconds)]
        elif (source == mac) == (len(answers) == 1) and len(answers) in {1, 2}:
            answers.append(float(seconds))
            if len(answers) == 3:
                found.append([b - a for a, b in itertools.pairwise(answers)])
    complete = [one["phases"] for one in view["start_ups"] if one["complete"]]
    assert len(complete) == len(found) >= 4
    # a machine that stalls between a frame and the farm's clock spoils one of them, not most
    for place, phase in enumerate(("parameters", "ready")):
        apart = [told[phase] - heard[place] for told, heard in zip(complete, found, strict=True)]
        assert statistics.median(apart) == pytest.approx(0, abs=0.05), apart
    assert all(phases["data"] >= 0 for phases in complete)
    assert statistics.median(phases["data"] for phases in complete) < 0.2
