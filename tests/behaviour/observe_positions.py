"""What readings show in position mode and by the sensor interface."""

from __future__ import annotations

import assembly_points
import pytest
from open_points import (
    COUNTS_E1,
    HOME,
    HOMED,
    IN_RANGE,
    JOG_1,
    JOG_2,
    REACHED,
    READY,
    START,
    STOPPED,
    TAKEN,
    Plc,
    home,
    kind,
    observes,
    speed_plc,
    start,
    task_plc,
)

WORD = 0x42
SEARCH, ON_THE_FLY, SET_HOME = 0x10, 0x80, 0x1000
#: STW1 while jogging: operation, and bits 4 to 6 at 0; real-time jogging.
JOGGING, REAL_TIME = 0x040F, 0x1000
#: MT_FEEDRATE by its PNU.
FEEDRATE = 101


@observes("homing-bit", {"level": True, "edge": False})
def homing_bit(name: str, behaviour: str) -> object:
    """Whether STW1.11 that rose in a task homes the axis behind it, so that its place is 0."""
    plc = task_plc(name, behaviour)
    assert start(plc, 1.0)
    plc.put(STW1=READY | HOME, wait=20)
    assert plc.rpm() > 100, "not while the task runs"
    plc.wait(3000)
    return abs(float(plc.axis.motor.position - plc.axis.homing.origin)) < 0.5


@observes("tasks-before-homing", {"allowed": True, "refused": False})
def tasks_before_homing(name: str, behaviour: str) -> object:
    """Whether a task begins without a home position."""
    plc = task_plc(name, behaviour, homed=False)
    assert not plc["ZSW1"] & HOMED
    return start(plc, 1.0)


@observes(
    "target-reached-bit",
    {"target": (False, False, True), "no-motion": (True, False, True), "task-active": (False, True, False)},
)
def target_reached_bit(name: str, behaviour: str) -> object:
    """ZSW1.10 before the first task, in it and behind it."""
    plc = task_plc(name, behaviour, homed=False)
    before = bool(plc["ZSW1"] & REACHED)
    if name.startswith("akd"):
        home(plc)
    assert start(plc, 5.0)
    plc.wait(100)
    during = bool(plc["ZSW1"] & REACHED)
    plc.wait(1500)
    assert plc["ZSW1"] & STOPPED
    return before, during, bool(plc["ZSW1"] & REACHED)


@observes("relative-task", {"last-target": 6, "here": 2})
def relative_task(name: str, behaviour: str) -> object:
    """Where a way of one revolution ends that begins one revolution from the start of a task over five."""
    if name == assembly_points.NAME:
        return assembly_points.relative_task(behaviour)
    plc = task_plc(name, behaviour)
    assert start(plc, 5.0)
    plc.wait_for(lambda: plc.axis.profile.position - plc.axis.homing.origin > 0.95)
    assert start(plc, 1.0, relative=True)
    plc.wait(1500)
    assert plc["ZSW1"] & (REACHED | STOPPED) == REACHED | STOPPED
    return round(float(plc.axis.motor.position - plc.axis.homing.origin))


@observes("resume-with-edge", {"new-task": (True, 2), "waiting-task": (False, 5)})
def resume_with_edge(name: str, behaviour: str) -> object:
    """Whether the edge was acknowledged that came with STW1.5, and where the axis comes to rest."""
    plc = task_plc(name, behaviour)
    assert start(plc, 5.0)
    plc.wait(50)
    plc.put(STW1=READY & ~0x0020, wait=200)
    assert plc.rpm() == pytest.approx(0.0, abs=1.0)
    target = "TARPOS_A" if kind(name) == "moog-msd" else "MDI_TARPOS"
    plc.put(wait=1, **{target: 2 * (COUNTS_E1 if name == "hiwin-e1" else 65536)})
    taken = bool(plc.put(STW1=READY | START) & TAKEN)
    plc.put(STW1=READY)
    plc.wait(1500)
    return taken, round(float(plc.axis.motor.position - plc.axis.homing.origin))


@observes("mdi-deselected", {"runs-on": 600, "rejected": 0})
def mdi_deselected(name: str, behaviour: str) -> object:
    """rpm of a task whose MDI bit fell."""
    plc = task_plc(name, behaviour)
    assert start(plc, 10.0)
    plc.wait(200)
    plc.put(SATZANW=0, wait=200)
    return round(plc.rpm())


@observes("following-error-bit", {"in-range": (True, False), "out-of-range": (False, True)})
def following_error_bit(name: str, behaviour: str) -> object:
    """ZSW1.8 at rest, and while the shaft is held fast in a task."""
    plc = task_plc(name, behaviour)
    at_rest = bool(plc["ZSW1"] & IN_RANGE)
    plc.inject("stuck-axis")
    start(plc, 5.0)
    plc.wait(100)
    return at_rest, bool(plc["ZSW1"] & IN_RANGE)


@observes("stopped-bit", {"at-rest": (True, False, True), "moving": (False, True, False)})
def stopped_bit(name: str, behaviour: str) -> object:
    """ZSW1.13 before a task, in it and behind it."""
    plc = task_plc(name, behaviour)
    before = bool(plc["ZSW1"] & STOPPED)
    assert start(plc, 5.0)
    plc.wait(100)
    during = bool(plc["ZSW1"] & STOPPED)
    plc.wait(1500)
    return before, during, bool(plc["ZSW1"] & STOPPED)


@observes("real-time-jog", {"free": (600, 600), "rejected": (0, 600)})
def real_time_jog(name: str, behaviour: str) -> object:
    """rpm of real-time jogging with STW1.4 = 0, and with 1."""
    plc = task_plc(name, behaviour)
    plc.put(wait=1, MDI_VELOCITY=2**32 // 20, MDI_ACC=39, MDI_DEC=39)
    plc.put(STW1=JOGGING | REAL_TIME, wait=200)
    without = round(plc.rpm())
    plc.put(STW1=JOGGING, wait=200)
    plc.put(STW1=JOGGING | REAL_TIME | 0x0010, wait=200)
    return without, round(plc.rpm())


@observes("feedrate-unit", {"percent": 300, "normalised": 2})
def feedrate_unit(name: str, behaviour: str) -> object:
    """rpm of a task of 600 rpm with an MT_FEEDRATE of 50."""
    plc = task_plc(name, behaviour)
    assert plc.change(FEEDRATE, WORD, 50) is None
    assert start(plc, 10.0)
    plc.wait(200)
    return round(plc.rpm())


# jogging


def jogger(name: str, behaviour: str, *, positions: bool) -> Plc:
    """In operation, ready to jog at 100 rpm by STW1.8 and at 50 rpm by STW1.9 (E1: both 100 rpm, to and fro)."""
    params = {
        "akd-profinet": f"{{1004: 273, 1005: 137, DRV.OPMODE: {2 if positions else 1}}}",
        "akd-profinet-2012": f"{{1004: 273, 1005: 137, 930: {2 if positions else 1}}}",
        "hiwin-e1": "{Pt533: 100}",
        "moog-msd": "{P-1268: 100, P-1269: 50}",
        "profidrive": "{p2585: 1000, p2586: 500}",
    }[kind(name)]
    plc = (
        task_plc(name, behaviour, homed=False, params=params)
        if positions
        else speed_plc(name, behaviour, params=params)
    )
    plc.put(STW1=JOGGING)
    return plc


def both(plc: Plc) -> tuple[str, str]:
    """What both bits do from rest, and behind STW1.9 alone."""
    words = {0: "stands", 100: "first", 50: "second", -100: "second"}
    seen = []
    for first in (0, JOG_2):
        plc.put(STW1=JOGGING | first, wait=200)
        plc.put(STW1=JOGGING | JOG_1 | JOG_2, wait=200)
        seen.append(words[round(plc.rpm())])
        plc.put(STW1=JOGGING, wait=200)
    return seen[0], seen[1]


@observes(
    "both-jog-bits",
    {
        "standstill": ("stands", "stands"),
        "first-speed": ("first", "first"),
        "first-bit": ("stands", "second"),
        "forwards": ("second", "second"),
    },
)
def both_jog_bits(name: str, behaviour: str) -> object:
    """What both bits do from rest, and behind STW1.9 alone, which table 10.10 says of the MSD."""
    if kind(name) == "moog-msd":
        plc = jogger(name, behaviour, positions=False)
        plc.put(STW1=JOGGING | JOG_1 | JOG_2, wait=300)
        return ("second" if plc.rpm() == pytest.approx(50, abs=1) else "stands",) * 2
    seen = both(jogger(name, behaviour, positions=True))
    if name.startswith("akd"):
        assert both(jogger(name, behaviour, positions=False)) == seen, "in velocity mode alike"
    return seen


@observes(
    "jog-prerequisite",
    {"throughout": (100, 0, 0), "at-start": (100, 100, 0), "none": (100, 100, 0), "task-bits-zero": (0, 100, 0)},
)
def jog_prerequisite(name: str, behaviour: str) -> object:
    """rpm of a jog: AKD with STW1.4 to 6 at 0, then set; E1 and profile the other way round; then without its bit."""
    if kind(name) in {"hiwin-e1", "profidrive"}:
        plc = jogger(name, behaviour, positions=True)
        words = (READY | JOG_1, JOGGING | JOG_1, JOGGING)
        return tuple(rpm_of(plc, word) for word in words)
    seen = []
    for positions, enabled in ((True, READY), (False, 0x047F)):
        plc = jogger(name, behaviour, positions=positions)
        words = (JOGGING | JOG_1, enabled | JOG_1, enabled)
        seen.append(tuple(rpm_of(plc, word) for word in words))
    assert seen[0] == seen[1], "in velocity mode alike"
    return seen[0]


def rpm_of(plc: Plc, word: int) -> int:
    plc.put(STW1=word, wait=300)
    return round(plc.rpm())


# positions of each cycle, sensor interface


@observes("interpolation-start", {"level": (True, True), "edge": (False, True)})
def interpolation_start(name: str, behaviour: str) -> object:
    """Whether positions lead the axis whose STW1.4 to 6 were set before operation, and behind the edge of bit 6."""
    plc = Plc(name, behaviour, 8)
    for word in (0x0476, 0x0477, 0x047F):
        plc.put(STW1=word)
    led = []
    for word in (READY | START, READY):
        plc.put(STW1=word)
        before = float(plc.axis.motor.position)
        plc.put(STW1=READY | START)
        for place in range(100):
            plc.put(XSOLL_A=round((before + place * 0.002) * 65536), wait=1)
        led.append(plc.axis.motor.position - before > 0.1)
        plc.put(XSOLL_A=round(plc.axis.motor.position * 65536), wait=50)
    return tuple(led)


@observes("measuring-on-the-fly", {"refused": (0x8000, 0x0F01), "ignored": (0x0001, 0)})
def measuring_on_the_fly(name: str, behaviour: str) -> object:
    """G1_ZSW and G1_XIST2 when G1_STW.7 comes with a function."""
    plc = speed_plc(name, behaviour)
    plc.put(G1_STW=0x0001 | SEARCH | ON_THE_FLY)
    return plc["G1_ZSW"], plc["G1_XIST2"]


@observes("sensor-home-position", {"refused": (0x8000, 0x0F01), "ignored": (0, 0)})
def sensor_home_position(name: str, behaviour: str) -> object:
    """G1_ZSW and G1_XIST2 when G1_STW.12 is set."""
    if name == "moog-msd-dp":
        # no standard telegram on PROFIBUS has the words of the encoder: a mapped one
        plc = Plc(name, behaviour, 106)
        plc.map_words(setpoints=[967, 1263], actual_values=[968, 1264, 1266, 1266])
    else:
        plc = Plc(name, behaviour, 3)
    plc.put(G1_STW=SET_HOME)
    return plc["G1_ZSW"], plc["G1_XIST2"]


# behind a power cycle


@observes("home-after-power-on", {"lost": False, "kept": True})
def home_after_power_on(name: str, behaviour: str) -> object:
    """ZSW1.11 behind a power cycle."""
    if name == assembly_points.NAME:
        return assembly_points.home_after_power_on(behaviour)
    plc = task_plc(name, behaviour, homed=False)
    home(plc)
    assert plc["ZSW1"] & HOMED
    plc.power_cycle()
    return bool(plc["ZSW1"] & HOMED)


@observes("task-ramps", {"scaled": 3900.0, "fixed": 39 * 50_000_000 / 65536})
def task_ramps(name: str, behaviour: str) -> object:
    """The acceleration of a task, rpm/s, with PNU 1008 = 100."""
    plc = task_plc(name, behaviour)
    assert plc.change(1008, 0x42, 100) is None
    assert start(plc, 5.0)
    return float(plc.axis.profile.acceleration)


# numbers of positions


def arrive(plc: Plc) -> None:
    plc.wait_for(lambda: plc["ZSW1"] & (REACHED | STOPPED) == REACHED | STOPPED, 10_000)


@observes("reference-point-in-a-task", {"number": (10, 13), "place": (7, 10)})
def reference_point_in_a_task(name: str, behaviour: str) -> object:
    """XIST_A where a task to 10 revolutions ends, and how far the shaft turned; the reference point comes after 3."""
    plc = Plc(name, behaviour, 111)
    plc.switch_on(operation=READY)
    plc.put(POS_STW1=0x8100, OVERRIDE=0x4000)
    assert start(plc, 10.0, 120.0)
    plc.wait_for(lambda: plc.axis.motor.position >= 3.0)
    plc.put(POS_STW2=0x0002, wait=1)
    arrive(plc)
    return round(plc["XIST_A"] / COUNTS_E1), round(float(plc.axis.motor.position))


@observes("targets-behind-a-wrap", {"as-shown": 412, "counted-on": -100})
def targets_behind_a_wrap(name: str, behaviour: str) -> object:
    """Where an absolute task to -100 revolutions leads to from 400, which XIST_A shows as -112."""
    plc = task_plc(name, behaviour)
    for target, relative in ((200.0, True), (200.0, True), (-100.0, False)):
        assert start(plc, target, 5000.0, relative=relative)
        arrive(plc)
    return round(float(plc.axis.motor.position))


@observes("interpolation-behind-homing", {"back": (1, 0, 1, True), "stays": (1, 0, 0, False)})
def interpolation_behind_homing(name: str, behaviour: str) -> object:
    """P-0301 before homing, in it and behind it, and whether positions of each cycle lead the axis then."""
    plc = Plc(name, behaviour, 8)
    plc.switch_on(operation=READY)
    plc.put(STW1=READY | START, XSOLL_A=0)
    found = [plc.read(301)]
    plc.put(STW1=READY | START | HOME)
    found.append(plc.read(301))
    plc.wait_for(lambda: plc["ZSW1"] & HOMED)
    plc.put(STW1=READY | START)
    found.append(plc.read(301))
    for cycle in range(200):
        plc.put(XSOLL_A=round(cycle * 0.005 * 65536), wait=1)
    return *found, abs(plc["XIST_A"] / 65536 - 1.0) < 0.05
