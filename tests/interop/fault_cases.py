"""One case for each PROFINET kind of fault: what is injected, and what a capture or a foreign tool must show of it.

Each check gets a :class:`fault_capture.View` and asserts what arrived at the far end of the cable, as Wireshark's
dissector reads it.
"""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import dataclass, field
from statistics import median
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable

    from fault_capture import Frame, View

#: 64 ms in units of the cycle counter.
CYCLE = 2048
WATCHDOG_SECONDS = 0.64
AKD = "model: akd-profinet"
#: With a sign of life.
E1 = "model: hiwin-e1, telegram: 3"
#: Octets behind the frame id: ZSW1 and NIST_A of the AKD's telegram 1 (behind four IOPS), ZSW2 of the E1's telegram 3.
ZSW1, NIST_A, E1_ZSW2 = 4, 6, 11
#: PNU of the AKD's DIN1.STATE (manual, 5.6).
DIN1_STATE = 2064
#: PNIO services (IEC 61158-6-10): operation numbers, block types.
CONNECT, READ, WRITE = 0, 2, 3
APPLICATION_READY, PARAMETER_END_ANSWER, ALARM_ACK = 0x0112, 0x8110, {0x8001, 0x8002}
#: DataStatus (IEC 61158-6-10): bits.
DATA_VALID, PROVIDER_RUN, NO_PROBLEM = 0x04, 0x10, 0x20
OTHER_MAC, SECOND_MAC = "02:aa:00:00:00:07", "02:aa:00:00:00:08"


@dataclass(frozen=True, slots=True)
class Case:
    """``also``: faults that go with it; ``records``: (verb, index, data) that the controller is asked for meanwhile."""

    check: Callable[[View], None]
    params: dict[str, Any] = field(default_factory=dict)
    also: tuple[str, ...] = ()
    records: tuple[tuple[str, int, str], ...] = ()
    drive: str = AKD
    fields: dict[str, Any] = field(default_factory=dict)


def request(pnu: int) -> str:
    """Base mode: read one parameter of axis 0."""
    return f"01010001 1001 {pnu:04x} 0000".replace(" ", "")


ASK = (("write", 47, request(DIN1_STATE)), ("read", 47, ""))


# -- frames


def lost(view: View) -> None:
    frames = view.during(view.cyclic)
    steps = view.steps(frames)
    assert set(view.steps(view.before(view.cyclic))) == {CYCLE}
    assert all(step > 0 and step % CYCLE == 0 for step in steps)
    share = 1 - len(steps) / (sum(steps) / CYCLE)
    assert 0.1 < share < 0.5, share


def delayed(view: View) -> None:
    late = median(view.lateness(view.during(view.cyclic))) - median(view.lateness(view.before(view.cyclic)))
    assert late == pytest.approx(0.04, abs=0.006)


def duplicated(view: View) -> None:
    steps = Counter(view.steps(view.during(view.cyclic)))
    assert set(steps) == {0, CYCLE}
    assert steps[0] == pytest.approx(2 * steps[CYCLE], abs=3), "two copies behind each frame"


def reordered(view: View) -> None:
    steps = view.steps(view.during(view.cyclic))
    assert any(step < 0 for step in steps)
    assert not any(step < 0 for step in view.steps(view.before(view.cyclic)))
    assert len({frame.counter for frame in view.during(view.cyclic)[:30]}) == 30, "nothing is repeated"


def corrupted(view: View) -> None:
    def padding(frames: list[Frame]) -> list[bytes]:
        return [frame.octets[26:56] for frame in frames if frame.octets[12:14] == b"\x88\x92"]

    assert set(padding(view.before(view.cyclic))) == {bytes(30)}
    found = [bool(any(octets)) for octets in padding(view.during(view.cyclic))]
    assert 0.1 < sum(found) / len(found) < 0.6


def throttled(view: View) -> None:
    frames = view.during(view.cyclic)
    # 60 octets, preamble, check and gap at 5 kbit/s
    assert median(view.gaps(frames)) > 0.12
    assert max(view.steps(frames)) > CYCLE


# -- link


def mute(view: View) -> None:
    assert view.before(view.sent)
    assert not view.during(view.sent)
    assert view.after(view.cyclic)


def mute_once(view: View) -> None:
    pairs = itertools.pairwise(frame.seconds for frame in view.cyclic)
    gaps = [(last, again) for last, again in pairs if again - last > WATCHDOG_SECONDS and again > view.quiet]
    assert gaps
    connects = [frame.seconds for _, frame in view.answers(CONNECT)]
    # a stalled machine may show a gap of its own
    assert any(last < at <= again for last, again in gaps for at in connects), "it was connected anew"


def flapping(view: View) -> None:
    # two gaps of 0.7 s, or one: on a busy machine the drive may not be connected anew between them
    frames = view.during(view.sent)
    gaps = view.gaps(frames)
    # it comes back from one of them at least; another may be at the begin, or at the end
    assert max(gaps) > 0.6, gaps
    gaps += [frames[0].seconds - view.began, view.ended - frames[-1].seconds]
    assert sum(gap for gap in gaps if gap > 0.6) >= 1.3, gaps


def another_mac(view: View) -> None:
    assert not view.during(view.sent)
    spoken = [frame for frame in view.others if frame["eth.src"] == OTHER_MAC]
    assert view.peers["profinet-py"]["mac-change"] == {OTHER_MAC}
    chassis = {
        frame.octets[14:].find(bytes.fromhex(OTHER_MAC.replace(":", "")))
        for frame in spoken
        if frame["lldp.chassis.subtype"]
    }
    assert chassis
    assert -1 not in chassis, "LLDP still has the other address"
    assert any(frame.cyclic for frame in spoken)
    assert not [frame for frame in spoken if frame.seconds > view.ended + 1.0]
    assert view.after(view.cyclic)


def two_of_an_address(view: View) -> None:
    ip = next(frame["ip.src"] for frame in view.sent if frame["ip.src"])
    answers = [
        f for f in view.during([*view.sent, *view.others]) if f["arp.opcode"] == "2" and f["arp.src.proto_ipv4"] == ip
    ]
    assert {frame["eth.src"] for frame in answers} == {view.mac, SECOND_MAC}
    assert set(view.steps(view.during(view.cyclic))) == {CYCLE}, "the connection goes on"


def two_of_a_name(view: View) -> None:
    assert view.peers["profinet-py"]["duplicate-name"] == {view.mac, SECOND_MAC}
    assert set(view.steps(view.during(view.cyclic))) == {CYCLE}, "the connection goes on"


# -- cyclic


def gap_of_five(view: View) -> None:
    steps = Counter(view.steps(view.cyclic))
    assert steps == {CYCLE: len(view.cyclic) - 2, 6 * CYCLE: 1}


def status_without(bit: int) -> Callable[[View], None]:
    def check(view: View) -> None:
        assert all(frame.status & bit for frame in view.before(view.cyclic))
        frames = view.during(view.cyclic)
        assert len(frames) > 5
        assert not any(frame.status & bit for frame in frames)

    return check


def bad_iops(view: View) -> None:
    assert {tuple(frame.ioxs) for frame in view.before(view.cyclic)[-5:]} == {(0x80,) * 6}
    # four submodules without data, then the telegram's IOPS and its IOCS
    seen = {tuple(frame.ioxs) for frame in view.during(view.cyclic)}
    assert seen == {(0x80,) * 4 + (0x40, 0x80)}, seen
    assert 0x0B in {frame.alarm for frame in view.after(view.sent)}, "return of submodule"


def bad_iocs(view: View) -> None:
    seen = {tuple(frame.ioxs) for frame in view.during(view.cyclic)}
    assert seen == {(0x80,) * 5 + (0x40,)}, seen


def frozen_counter(view: View) -> None:
    frames = view.during(view.cyclic)
    assert view.steps(frames)[:5] == [0] * 5


def jumped_counter(view: View) -> None:
    steps = Counter(view.steps(view.during(view.cyclic)))
    assert CYCLE + 5000 in view.steps([f for f in view.cyclic if f.seconds < view.ended])
    assert set(steps) <= {CYCLE, CYCLE + 5000}
    assert CYCLE - 5000 in view.steps([f for f in view.cyclic if f.seconds > view.began]), "and back at the end"


def another_frame_id(view: View) -> None:
    assert 0xBBF0 not in {frame.number("pn_rt.frame_id") for frame in view.before(view.cyclic)}
    assert {frame.number("pn_rt.frame_id") for frame in view.during(view.cyclic)} == {0xBBF0}


def longer(view: View) -> None:
    (usual,) = {len(frame.octets) for frame in view.before(view.cyclic)}
    assert {len(frame.octets) for frame in view.during(view.cyclic)} == {usual + 20}


def some_late(view: View) -> None:
    usual = median(view.lateness(view.before(view.cyclic)))
    late = [seconds - usual for seconds in view.lateness(view.during(view.cyclic))]
    share = sum(0.014 < seconds < 0.03 for seconds in late) / len(late)
    assert 0.3 < share < 0.7, share


# -- liveness


def counts(frames: list[Frame]) -> list[int]:
    return [frame.word(E1_ZSW2) >> 12 for frame in frames]


def differences(frames: list[Frame]) -> list[int]:
    """From count to count, modulo 15."""
    found = counts(frames)
    return [(b - a) % 15 for a, b in itertools.pairwise(found)]


def life_stands(view: View) -> None:
    assert set(differences(view.before(view.cyclic)[-10:])) != {0}
    assert len(set(counts(view.during(view.cyclic)))) == 1
    assert set(differences(view.after(view.cyclic)[-10:])) != {0}
    assert set(view.steps(view.during(view.cyclic))) == {CYCLE}, "all else goes on"


def life_skips(view: View) -> None:
    usual = Counter(differences(view.before(view.cyclic))).most_common(1)[0][0]
    steps = Counter(differences(view.during(view.cyclic)))
    assert steps[(usual + 3) % 15] > 1
    assert steps[usual] > 1
    assert 0 not in counts(view.during(view.cyclic)), "0 means: no sign of life"


# -- connection


def aborted_with(code: int) -> Callable[[View], None]:
    def check(view: View) -> None:
        errors = [frame for frame in view.sent if frame.aborts]
        assert errors, "no ERR-RTA-PDU"
        assert errors[0].number("pn_io.error_code") == 0xCF
        assert errors[0].number("pn_io.error_decode") == 0x81
        assert errors[0].number("pn_io.error_code1") == 0xFD
        assert errors[0].number("pn_io.error_code2") == code
        assert any(frame.seconds > errors[0].seconds for _, frame in view.answers(CONNECT)), "it comes back"

    return check


def refused(view: View) -> None:
    answers = view.during([frame for _, frame in view.answers(CONNECT)])
    assert answers
    found = {tuple(f.number(f"pn_io.error_{c}") for c in ("code", "decode", "code1", "code2")) for f in answers}
    assert found == {(0xDB, 0x81, 0x40, 0x04)}, found
    assert not view.during(view.cyclic)


def parameters_ended(view: View) -> float:
    """When the drive answered the end of the parameters, while the fault was in force."""
    found = [frame.seconds for frame in view.calls(PARAMETER_END_ANSWER) if view.quiet < frame.seconds < view.ended]
    return found[0]


def never_ready(view: View) -> None:
    assert parameters_ended(view)
    assert not view.during(view.calls(APPLICATION_READY))
    assert view.after(view.calls(APPLICATION_READY))


def ready_late(view: View) -> None:
    ended = parameters_ended(view)
    ready = [frame.seconds for frame in view.calls(APPLICATION_READY) if frame.seconds > ended]
    # a busy machine adds to it
    assert 1.49 < ready[0] - ended < 4.0


def no_datagrams(view: View) -> None:
    assert view.during([frame for frame in view.got if frame["udp.length"]]), "nobody asked"
    assert not view.during([frame for frame in view.sent if frame["udp.length"]])
    assert view.during([frame for frame in view.sent if frame["pn_dcp.service_type"]]), "DCP goes on"


def not_found(view: View) -> None:
    assert "dcp-silence" not in view.peers["profinet-py"]
    assert not view.during([frame for frame in view.sent if frame["pn_dcp.service_id"]])
    assert set(view.steps(view.during(view.cyclic))) == {CYCLE}


def alarm_of(kind: int) -> Callable[[View], None]:
    def check(view: View) -> None:
        assert kind not in {frame.alarm for frame in view.before(view.sent)}
        assert kind in {frame.alarm for frame in view.sent if frame.seconds < view.ended}
        assert 0x04 in {frame.alarm for frame in view.after(view.sent)} or kind == 0x01, "plug alarm at the end"

    return check


def answered_late(opnum: int, seconds: float) -> Callable[[View], None]:
    def check(view: View) -> None:
        waits = [wait for wait, frame in view.answers(opnum) if view.began < frame.seconds < view.ended + 1.0]
        assert waits
        assert seconds - 0.005 < max(waits) < seconds + 0.4, waits

    return check


# -- records


def refused_read(*codes: int) -> Callable[[View], None]:
    def check(view: View) -> None:
        answers = view.during([frame for _, frame in view.answers(READ)])
        found = [tuple(f.number(f"pn_io.error_{c}") for c in ("code", "decode", "code1")) for f in answers]
        assert (0xDE, 0x80, *codes) in found, found

    return check


# -- alarms


def storm(view: View) -> None:
    alarms = view.during([frame for frame in view.sent if frame.alarm == 0x02])
    acks = view.during([f for f in view.got if f.number("pn_io.block_type") in ALARM_ACK])
    assert len(alarms) > 30
    assert len({frame["pn_io.send_seq_num"] for frame in alarms}) > 30
    assert len(acks) >= len(alarms) - 1


def no_ack(view: View) -> None:
    alarms = [frame for frame in view.sent if frame.alarm == 0x02]
    acks = [f for f in view.got if f.number("pn_io.block_type") in ALARM_ACK and f.seconds > alarms[0].seconds]
    repeated = Counter(frame["pn_io.send_seq_num"] for frame in acks)
    assert max(repeated.values()) >= 3, "the controller repeats its AlarmAck"
    assert any(frame.aborts for frame in [*view.sent, *view.got]), "and gives up"


def diagnosis(view: View) -> None:
    alarm_of(0x01)(view)
    status_without(NO_PROBLEM)(view)
    assert all(frame.status & NO_PROBLEM for frame in view.after(view.cyclic)[-5:])


# -- drive


def zsw1_bit(number: int, *, always: bool = True) -> Callable[[View], None]:
    def check(view: View) -> None:
        def bits(frames: list[Frame]) -> set[int]:
            return {frame.word(ZSW1) >> number & 1 for frame in frames}

        assert bits(view.before(view.cyclic)[-10:]) == {0}
        if always:
            assert bits(view.during(view.cyclic)) == {1}
        else:
            assert 1 in bits([frame for frame in view.cyclic if frame.seconds < view.ended])
        assert bits(view.after(view.cyclic)[-5:]) == {0}

    return check


def stays_although_acknowledged(view: View) -> None:
    zsw1_bit(3)(view)
    before = next(frame.octets for frame in reversed(view.before(view.got)) if frame.cyclic)
    # STW1 in operation, wherever the controller laid it
    place = before.index(b"\x04\x7f", 16)
    assert sum(frame.octets[place + 1] >> 7 & 1 for frame in view.during(view.got) if frame.cyclic), "acknowledged"


def swing(frames: list[Frame]) -> int:
    speeds = [(frame.word(NIST_A) + 0x8000) % 0x10000 - 0x8000 for frame in frames]
    return max(speeds) - min(speeds)


def sluggish(view: View) -> None:
    assert swing(view.before(view.cyclic)[-20:]) > 200
    assert swing(view.during(view.cyclic)[-30:]) < 0.6 * swing(view.before(view.cyclic)[-20:])


def jammed(view: View) -> None:
    assert swing(view.during(view.cyclic)[-30:]) <= 2


def inhibited(view: View) -> None:
    assert {frame.word(ZSW1) & 0x47 for frame in view.during(view.cyclic)} == {0x40}


def input_on(view: View) -> None:
    answers = [frame.octets for _, frame in view.answers(READ) if view.began < frame.seconds < view.ended]
    # base mode: positive response to one read; format 0x41 (octet), one value: 1
    assert [octets.rstrip(b"\0")[-7:].hex() for octets in answers] == ["01010001410101"]


def power_cycled(view: View) -> None:
    mute_once(view)
    gap = max(view.gaps(view.sent))
    assert gap > 0.9
    assert not any(frame.aborts for frame in view.sent), "no farewell"


OUT = {"direction": "out"}
CASES: dict[str, Case] = {
    "loss": Case(lost, {"frames": "cyclic"}, fields={"probability": 0.3, "seed": 7, **OUT}),
    "delay": Case(delayed, {"frames": "cyclic", "delay": "40ms"}, fields=OUT),
    "duplicate": Case(duplicated, {"frames": "cyclic", "copies": 2}, fields=OUT),
    "reorder": Case(reordered, {"frames": "cyclic"}, fields={"probability": 0.2, "seed": 7, **OUT}),
    "corrupt": Case(corrupted, {"frames": "cyclic", "bits": 8}, fields={"probability": 0.3, "seed": 7, **OUT}),
    "throttle": Case(throttled, {"frames": "cyclic", "rate": 5.0}, fields=OUT),
    "silence": Case(mute),
    "timeout": Case(mute_once),
    "link-down": Case(mute),
    "link-flap": Case(flapping, {"period": "1500ms", "down": "700ms"}),
    "mac-change": Case(another_mac, {"mac": OTHER_MAC}),
    "duplicate-ip": Case(two_of_an_address, {"mac": SECOND_MAC, "every": "1s"}),
    "duplicate-name": Case(two_of_a_name, {"mac": SECOND_MAC}),
    "drop-cycles": Case(gap_of_five, fields={"count": 5}),
    "provider-stop": Case(status_without(PROVIDER_RUN)),
    "data-invalid": Case(status_without(DATA_VALID)),
    "iops-bad": Case(bad_iops),
    "iocs-bad": Case(bad_iocs),
    "cycle-counter-freeze": Case(frozen_counter),
    "cycle-counter-jump": Case(jumped_counter, {"by": 5000}),
    "wrong-frame-id": Case(another_frame_id, {"frame_id": 0xBBF0}),
    "wrong-length": Case(longer, {"by": 20}),
    "late-frames": Case(some_late, {"by": "20ms"}, fields={"probability": 0.5, "seed": 7}),
    "sign-of-life-freeze": Case(life_stands, drive=E1),
    "sign-of-life-skip": Case(life_skips, {"by": 3}, drive=E1, fields={"probability": 0.4, "seed": 7}),
    "sign-of-life-loss": Case(life_stands, drive=E1),
    # IEC 61158-6-10, RTA_ERR_CLS_PROTOCOL: AR device deactivated 16, data hold timer expired 5
    "ar-abort": Case(aborted_with(16), {"code": "device-deactivated"}),
    "connect-refuse": Case(refused, also=("ar-abort",)),
    "no-application-ready": Case(never_ready, also=("ar-abort",)),
    "late-application-ready": Case(ready_late, {"delay": "1500ms"}, also=("ar-abort",)),
    "rpc-silence": Case(no_datagrams, also=("ar-abort",)),
    "dcp-silence": Case(not_found),
    "module-missing": Case(alarm_of(0x03)),
    "module-wrong": Case(alarm_of(0x0A)),
    "watchdog-expire": Case(aborted_with(5)),
    "rpc-delay": Case(answered_late(READ, 0.3), {"delay": "300ms"}, records=ASK),
    "record-error": Case(refused_read(0xA9), {"code": "not-supported"}, records=(("read", 47, ""),)),
    "parameter-busy": Case(refused_read(0xB5), records=ASK),
    "record-delay": Case(answered_late(READ, 0.3), {"delay": "300ms"}, records=ASK),
    "alarm-storm": Case(storm, {"interval": "20ms"}),
    "alarm-unacknowledged": Case(no_ack),
    "diagnosis": Case(diagnosis),
    "drive-fault": Case(zsw1_bit(3, always=False), {"fault": 702}),
    "f702": Case(zsw1_bit(3, always=False)),
    "drive-warning": Case(zsw1_bit(7), {"warning": 107}),
    "fault-not-acknowledging": Case(stays_although_acknowledged, also=("f702",)),
    "undervoltage": Case(zsw1_bit(3)),
    "encoder-error": Case(zsw1_bit(3)),
    "following-error": Case(zsw1_bit(3)),
    "sto": Case(zsw1_bit(3)),
    "limit-switch": Case(zsw1_bit(7)),
    "load": Case(sluggish, {"inertia": 0.5}),
    "stuck-axis": Case(jammed),
    "slow-ramp": Case(sluggish, {"factor": 50.0}),
    "not-ready": Case(inhibited),
    "digital-input": Case(input_on, {"input": 0}, records=ASK),
    "power-cycle": Case(power_cycled),
}  # fmt: skip
