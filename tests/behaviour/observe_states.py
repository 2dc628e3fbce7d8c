"""What readings show by the state machine, by STW1 and ZSW1 in speed control, and by the sign of life."""

from __future__ import annotations

import pytest
from open_points import ACKNOWLEDGE, FAULT, IN_RANGE, JOG_1, JOG_2, REACHED, RUN, SPEED, Plc, kind, observes, speed_plc

#: 600 rpm in each drive's set point: signal and number.
RPM = 600.0
CONTROL_REQUESTED = 0x0200
STATES = {0x40: "S1", 0x01: "S2", 0x03: "S3", 0x07: "S4"}
#: STW1 while jogging: operation, and bits 4 to 6 at 0.
JOGGING = 0x040F


def set_point(name: str, rpm: float) -> dict[str, int]:
    if name == "hiwin-e1":
        return {"NSOLL_B": round(rpm / 3000 * 0x40000000)}
    step = {"moog-msd": 1.0, "profidrive": 3000 / 0x4000}.get(kind(name), 12000 / 2**15)
    return {"NSOLL_A": round(rpm / step)}


def turning(name: str, behaviour: str, *, params: str | None = None, **options) -> Plc:
    """In operation, at 600 rpm; an E1 that coasts does so without its dynamic brake."""
    usual = "{Pt001: 2}" if name == "hiwin-e1" else "{}"
    plc = speed_plc(name, behaviour, params=params or usual, **options)
    plc.put(**set_point(name, RPM), wait=400)
    assert plc.rpm() == pytest.approx(RPM, abs=2.0)
    return plc


def state(plc: Plc) -> str:
    return STATES[plc["ZSW1"] & 0x47]


def what_is_left(plc: Plc) -> tuple[str, str]:
    """The state, and whether the axis goes on, stops or coasts, half a second later."""
    plc.wait(500)
    rpm = plc.rpm()
    return state(plc), "goes on" if rpm > RPM - 5 else "stands" if abs(rpm) < 5 else "coasts"


@observes("control-by-plc", {"hold": ("S4", "goes on"), "coast": ("S1", "coasts"), "ignored": ("S2", "stands")})
def control_by_plc(name: str, behaviour: str) -> object:
    """The axis after a word without STW1.10 and STW1.0."""
    plc = turning(name, behaviour, **LIGHT)
    plc.put(STW1=RUN & ~0x0401, **set_point(name, 0.0))
    return what_is_left(plc)


#: A load that takes seconds to come to rest when the axis coasts.
LIGHT = {"load": "{friction: 0.0, inertia: 0.002, damping: 0.0001}"}


@observes("controller-stop", {"coast": ("S1", "coasts"), "ramp": ("S2", "stands"), "hold": ("S4", "goes on")})
def controller_stop(name: str, behaviour: str) -> object:
    """The axis while the controller is in STOP."""
    chosen = behaviour
    if name == "akd-profinet-2012":
        chosen = behaviour.replace("{", "{fault-on-plc-stop: no-fault, ").replace(", }", "}")
    params = "{FBUS.PARAM02: 0}" if name == "akd-profinet" else None
    plc = turning(name, chosen, params=params, **LIGHT)
    plc.stop_controller()
    plc.put(STW1=0, **set_point(name, 0.0))
    assert not plc["ZSW1"] & FAULT
    return what_is_left(plc)


@observes("switch-on", {"bit-0": ("S2", "S2", "S4"), "bit-0-or-3": ("S2", "S3", "S4")})
def switch_on(name: str, behaviour: str) -> object:
    """The states behind the second, the third and the fourth word of the manual's sample."""
    plc = Plc(name, behaviour, SPEED[kind(name)])
    plc.put(STW1=0x0400)
    seen = []
    for word in (0x0406, 0x040E, 0x040F):
        plc.put(STW1=word, wait=20)
        seen.append(state(plc))
    return tuple(seen)


@observes("switching-on-inhibit", {"off-first": "S1", "leaves": "S4"})
def switching_on_inhibit(name: str, behaviour: str) -> object:
    """The state when the word of operation comes in S1."""
    plc = Plc(name, behaviour, SPEED[kind(name)])
    assert state(plc) == "S1"
    plc.put(STW1=RUN, wait=30)
    return state(plc)


@observes("off-in-operation", {"ramp": ("S2", "stands"), "coast": ("S2", "coasts")})
def off_in_operation(name: str, behaviour: str) -> object:
    plc = turning(name, behaviour, **LIGHT)
    plc.put(STW1=RUN & ~0x0001)
    return what_is_left(plc)


@observes("fault-acknowledge", {"edge": True, "level": False})
def fault_acknowledge(name: str, behaviour: str) -> object:
    """Whether a fault is there half a second after it came, STW1.7 being set all the time."""
    plc = speed_plc(name, behaviour)
    plc.put(STW1=RUN | ACKNOWLEDGE)
    plc.inject("drive-fault", fault=702)
    plc.wait(500)
    return bool(plc["ZSW1"] & FAULT)


@observes(
    "sign-of-life",
    {"watched": (True, True), "isochronous-only": (False, True), "none": (False, False), "sent": (False, True)},
)
def sign_of_life(name: str, behaviour: str) -> object:
    """Whether a count that stops raises a fault, and whether the drive counts itself."""
    watches = kind(name) in {"hiwin-e1", "moog-msd", "profidrive"}
    plc = Plc(name, behaviour, 3 if watches else 9, params="{925: 2}" if watches else "{}")
    plc.wait(60)
    before = plc["ZSW2"] >> 12
    # no more counting: the frames go on with the same word
    plc.run(0.4)
    seen = {before}
    for _ in range(20):
        plc.run(0.001)
        seen.add(plc["ZSW2"] >> 12)
    return bool(plc["ZSW1"] & FAULT), len(seen) > 3


def jogging(name: str, behaviour: str, **options) -> Plc:
    """In operation, ready to jog in speed control: forwards at 100 rpm, at 50 rpm by the other bit."""
    speeds = "{P-1268: 100, P-1269: 50}" if kind(name) == "moog-msd" else "{1004: 273, 1005: 137}"
    plc = Plc(name, behaviour, SPEED[kind(name)], params=speeds, **options)
    plc.switch_on(operation=JOGGING)
    return plc


@observes("jog-direction-bit", {"goes-on": 100, "ends": 0})
def jog_direction_bit(name: str, behaviour: str) -> object:
    """rpm when STW1.8, which gave the direction, falls and STW1.9 stays set."""
    plc = jogging(name, behaviour)
    plc.put(STW1=JOGGING | JOG_1, wait=300)
    assert plc.rpm() == pytest.approx(100, abs=1)
    plc.put(STW1=JOGGING | JOG_1 | JOG_2, wait=300)
    assert plc.rpm() == pytest.approx(50, abs=1)
    plc.put(STW1=JOGGING | JOG_1, wait=300)
    plc.put(STW1=JOGGING | JOG_2, wait=300)
    return round(plc.rpm())


@observes("ramp-generator-off", {"ramp": True, "at-once": False})
def ramp_generator_off(name: str, behaviour: str) -> object:
    """Whether the axis still turns 15 ms after STW1.4 fell; its ramp takes 60 ms."""
    plc = turning(name, behaviour)
    plc.put(STW1=RUN & ~0x0010, wait=15)
    return plc.rpm() > RPM / 2


@observes("speed-error-bit", {"ramp": (True, True), "set-point": (False, True), "zero": (False, False)})
def speed_error_bit(name: str, behaviour: str) -> object:
    """ZSW1.8 while the ramp generator is frozen at half of the set point, and in a steady run."""
    plc = speed_plc(name, behaviour)
    plc.put(**set_point(name, RPM / 2), wait=400)
    plc.put(STW1=RUN & ~0x0020)
    plc.put(**set_point(name, RPM), wait=200)
    assert plc.rpm() == pytest.approx(RPM / 2, abs=2.0)
    frozen = bool(plc["ZSW1"] & IN_RANGE)
    plc.put(STW1=RUN, wait=600)
    return frozen, bool(plc["ZSW1"] & IN_RANGE)


@observes("speed-reached-bit", {"window": (True, False), "exceeded": (True, True), "zero": (False, False)})
def speed_reached_bit(name: str, behaviour: str) -> object:
    """ZSW1.10 in a steady run, and while the axis still turns faster than a new set point."""
    plc = turning(name, behaviour, **LIGHT)
    steady = bool(plc["ZSW1"] & REACHED)
    plc.put(**set_point(name, RPM / 6), wait=8)
    assert RPM / 6 + 20 < plc.rpm() < RPM
    return steady, bool(plc["ZSW1"] & REACHED)


@observes("control-requested-bit", {"ready": (True, True), "shows-bit-10": (False, True)})
def control_requested_bit(name: str, behaviour: str) -> object:
    """ZSW1.9 before STW1.10 is set, and then."""
    plc = Plc(name, behaviour, SPEED[kind(name)])
    without = bool(plc.put(STW1=0x0006) & CONTROL_REQUESTED)
    return without, bool(plc.put(STW1=0x0406) & CONTROL_REQUESTED)
