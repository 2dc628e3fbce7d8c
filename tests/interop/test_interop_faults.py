"""Every PROFINET kind of fault, as the far end of the cable sees it: a capture dissected by Wireshark, foreign tools.

One farm has a drive for each kind, all faults are in force at the same time, and the built-in controller runs the
drives; nothing here asks the farm what it did.
"""

from __future__ import annotations

import time

import pytest
from fault_capture import View, read_capture
from fault_cases import CASES, CYCLE
from interop_rig import Capture, running
from kinds_of import kinds_of
from tools import needed

from pnfarm.buses.registry import bus

pytestmark = pytest.mark.slow

pytest.importorskip("scapy", reason="needs the package scapy")
pytest.importorskip("profinet", reason="needs the package profinet-py")

KINDS = [kind.name for kind in kinds_of("profinet")]
PLC = """
controller:
  name: plc
  ip: 10.77.3.250/22
  mac: 02:00:00:00:fa:01
  link: {kind: macvlan, parent: plc0}
  cycle: 64ms
  watchdog_factor: 10
  program: {kind: sine, speed_rpm: 300, period: 1s, acknowledge_after: 200ms}
  reconnect: {after: 200ms}
"""
BYSTANDERS = "{name: 'bystander-{n}', count: 4, model: akd-profinet, ip: 10.77.2.1/22, limits: lax}"
#: Before the faults, in which all drives run undisturbed; from the injections on; after the drives run again.
QUIET_SECONDS, FAULTY_SECONDS, AFTER_SECONDS = 1.0, 5.0, 1.0
#: What a fault needs to be in force: the interface goes down, the drive boots.
SETTLE_SECONDS = 0.35


def drive(number: int, kind: str) -> str:
    """The kind's own drive, named after it."""
    ramp = ", params: {DRV.ACC: 10000000, DRV.DEC: 10000000}" if kind == "slow-ramp" else ""
    return f"{{name: {kind}, {CASES[kind].drive}, ip: 10.77.1.{number + 1}/22, limits: lax{ramp}}}"


def injected(farm) -> dict[str, tuple[float, float]]:
    """Put every fault on its drive; the times before and after."""
    times = {}
    for kind, case in CASES.items():
        before = farm.ask("inject", kind=kind, on=kind, params=case.params, **case.fields)
        for other in case.also:
            farm.ask("inject", kind=other, on=kind)
        times[kind] = before, time.time()
    return times


@pytest.fixture(scope="module")
def views(lab, tmp_path_factory):
    needed("tshark", "dumpcap", "ping")
    folder = tmp_path_factory.mktemp("faults")
    # Wireshark confuses the first frame ids with those of outputs, which drives choose from 0x8000 on: no fault's
    drives = [BYSTANDERS, *(drive(number, kind) for number, kind in enumerate(CASES))]
    with Capture(lab, folder / "faults.pcapng") as capture, running(lab, folder, drives) as farm:
        macs = {found["name"]: found["mac"] for found in farm.ask("drives")}
        with running(lab, folder, drives, rest=PLC, kind="plc", where="peer") as plc:
            assert plc.ask("wait_connected", seconds=30), plc.ask("summary")
            assert plc.ask("wait_running", seconds=30), plc.ask("summary")
            time.sleep(QUIET_SECONDS)
            began = injected(farm)
            end = time.monotonic() + FAULTY_SECONDS
            peers = asked(lab, plc, list(CASES).index("duplicate-ip"))
            time.sleep(max(0.0, end - time.monotonic()))
            ended = time.time()
            farm.ask("clear")
            assert plc.ask("wait_connected", seconds=30), plc.ask("summary")
            assert plc.ask("wait_running", seconds=30), plc.ask("summary")
            time.sleep(AFTER_SECONDS)
            assert farm.ask("injections") == []
    frames = read_capture(capture.path)
    quiet, last = min(before for before, _ in began.values()), ended
    found = {}
    bystander, *_ = (macs.pop(f"bystander-{n}") for n in range(1, 5))
    for kind, mac in macs.items():
        own = {mac, "02:aa:00:00:00:07", "02:aa:00:00:00:08"}
        found[kind] = View(
            mac,
            began[kind][0],
            began[kind][1] + SETTLE_SECONDS,
            ended,
            [frame for frame in frames if frame["eth.src"] == mac],
            [frame for frame in frames if frame["eth.dst"] == mac],
            [frame for frame in frames if frame["eth.src"] in own - {mac}],
            peers,
        )
    found["bystander"] = View(bystander, quiet, quiet, last, [f for f in frames if f["eth.src"] == bystander])
    return found


def asked(lab, plc, place):
    """What other tools find while the faults are in force: profinet-py's scan, the kernel's ARP, records."""
    for kind, case in CASES.items():
        for verb, index, data in case.records:
            plc.ask(verb, name=kind, index=index, **({"data": data} if data else {}))
    # the kernel asks by ARP who has the address
    lab.run("peer", "ping", "-c", 1, "-W", 1, f"10.77.1.{place + 1}", check=False)
    named: dict[str, set[str]] = {}
    for device in lab.peer_json("peer_profinet_py.py", "discover"):
        named.setdefault(device["name"], set()).add(device["mac"])
    return {"profinet-py": named}


def test_every_kind_of_fault_has_a_case_of_its_own():
    assert set(CASES) == set(KINDS)
    assert {kind.name for kind in bus("profinet").fault_kinds()} <= set(CASES)


@pytest.mark.parametrize("kind", KINDS)
def test_the_far_end_sees_what_the_fault_does(views, kind):
    CASES[kind].check(views[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_the_far_end_sees_a_healthy_drive_again(views, kind):
    view = views[kind]
    last = view.cyclic[-8:]
    assert set(view.steps(last)) == {CYCLE}
    assert {frame.status for frame in last} == {0x35}
    assert {value for frame in last for value in frame.ioxs} == {0x80}
    assert len({(len(frame.octets), frame["pn_rt.frame_id"]) for frame in last}) == 1


def test_a_drive_beside_them_all_sends_every_frame_as_ever(views):
    view = views["bystander"]
    frames = view.during(view.cyclic)
    assert len(frames) > 50
    assert set(view.steps(frames)) == {CYCLE}
    assert {(frame.status, len(frame.octets)) for frame in frames} == {(0x35, len(frames[0].octets))}
    assert not [frame for frame in view.sent if frame.alarm is not None]
