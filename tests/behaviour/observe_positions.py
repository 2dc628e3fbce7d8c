"""What readings show in position mode and by the sensor interface."""

from __future__ import annotations

from open_points import HOME, HOMED, REACHED, READY, START, STOPPED, TAKEN, Plc, observes, speed_plc, task_plc

#: Of the E1: increments to a revolution, and a task of 600 rpm.
COUNTS = 1 << 23
SEARCH, ON_THE_FLY = 0x10, 0x80


def task(name: str, revolutions: float, rpm: float = 600.0, *, relative: bool = False) -> dict[str, int]:
    """The data of a task by MDI, with ramps of 30,000 rpm/s (AKD), 60,000 rpm/s (E1)."""
    counts = COUNTS if name == "hiwin-e1" else 65536
    velocity = rpm * COUNTS / 1000 if name == "hiwin-e1" else rpm / 12000 * 2**32
    ramp = 0x4000 if name == "hiwin-e1" else 39
    return {
        "SATZANW": 0x8000,
        "MDI_TARPOS": round(revolutions * counts),
        "MDI_VELOCITY": round(velocity),
        "MDI_ACC": ramp,
        "MDI_DEC": ramp,
        "MDI_MOD": 0 if relative else 1,
    }


def go(plc: Plc) -> bool:
    """The edge of STW1.6; whether the task was acknowledged.  The bit falls again."""
    taken = bool(plc.put(STW1=READY | START) & TAKEN)
    plc.put(STW1=READY)
    return taken


@observes("homing-bit", {"level": True, "edge": False})
def homing_bit(name: str, behaviour: str) -> object:
    """Whether STW1.11 that rose in a task homes the axis behind it."""
    plc = task_plc(name, behaviour)
    plc.put(**task(name, 1.0))
    assert go(plc)
    plc.axis.homed = 0
    plc.put(STW1=READY | HOME, wait=20)
    assert not plc["ZSW1"] & HOMED, "not while the task runs"
    plc.wait(3000)
    return bool(plc["ZSW1"] & HOMED)


@observes("tasks-before-homing", {"allowed": True, "refused": False})
def tasks_before_homing(name: str, behaviour: str) -> object:
    """Whether a task begins without a home position."""
    plc = task_plc(name, behaviour, homed=False)
    assert not plc["ZSW1"] & HOMED
    plc.put(**task(name, 1.0))
    return go(plc)


@observes("target-reached-bit", {"target": (False, False, True), "no-motion": (True, False, True)})
def target_reached_bit(name: str, behaviour: str) -> object:
    """ZSW1.10 before the first task, in it and behind it."""
    plc = task_plc(name, behaviour)
    before = bool(plc["ZSW1"] & REACHED)
    plc.put(**task(name, 5.0))
    assert go(plc)
    plc.wait(100)
    during = bool(plc["ZSW1"] & REACHED)
    plc.wait(1500)
    assert plc["ZSW1"] & STOPPED
    return before, during, bool(plc["ZSW1"] & REACHED)


@observes("measuring-on-the-fly", {"refused": (0x8000, 0x0F01), "ignored": (0x0001, 0)})
def measuring_on_the_fly(name: str, behaviour: str) -> object:
    """G1_ZSW and G1_XIST2 when G1_STW.7 comes with a function."""
    plc = speed_plc(name, behaviour)
    plc.put(G1_STW=0x0001 | SEARCH | ON_THE_FLY)
    return plc["G1_ZSW"], plc["G1_XIST2"]
