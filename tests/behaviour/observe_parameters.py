"""What readings show by parameters and by faults."""

from __future__ import annotations

import assembly_points
from open_points import FAULT, RUN, SPEED, Plc, kind, observes, speed_plc

from pnfarm.drives.catalogue import model

BYTE, WORD, UNSIGNED16 = 0x41, 0x42, 0x06
#: The PNU of the operation mode, its format, and its number of another mode than that of the speed.
MODE = {"akd-profinet": (2135, BYTE, 2), "akd-profinet-2012": (930, WORD, 2), "moog-msd": (300, WORD, 3)}
JOG_SPEED = 1004
#: PNU 925 of the E1, and its default.
TOLERANCE = 925
#: PL.FB of the AKD.
POSITION = 2294


@observes("mode-change", {"at-once": (None, True), "disabled-only": (0x11, False)})
def mode_change(name: str, behaviour: str) -> object:
    """The error of a change in operation, and whether the mode is the new one."""
    if name == assembly_points.NAME:
        return assembly_points.mode_change(behaviour)
    plc = speed_plc(name, behaviour)
    pnu, form, other = MODE[kind(name)]
    error = plc.change(pnu, form, other)
    changed = plc.read(pnu) == other
    plc.put(STW1=0x0406)
    plc.wait_for(lambda: plc.axis.drive.state < 4)
    assert plc.change(pnu, form, other) is None, "and in any case while the power stage is off"
    return error, changed


@observes("change-formats", {"listed": (0x17, False), "any": (None, True)})
def change_formats(name: str, behaviour: str) -> object:
    """The error of a change as Unsigned16, and whether the value is the new one."""
    plc = Plc(name, behaviour, 1)
    return plc.change(JOG_SPEED, UNSIGNED16, 100), plc.read(JOG_SPEED) == 100


@observes("profile-parameters", {"there": "axis-01", "listed-only": 0x00})
def profile_parameters(name: str, behaviour: str) -> object:
    """The name of the station by PNU 61000, or the error that it and the others are refused with."""
    plc = Plc(name, behaviour, SPEED[kind(name)])
    (point,) = [point for point in model(name).behaviour if point.name == "profile-parameters"]
    *others, last = point.readings["listed-only"].model["access", "absent"]
    answer = plc.ask(last, 7)
    assert {plc.ask(pnu).negative for pnu in others} == {answer.negative}, "all of them, or none"
    values = answer.entries[0].values
    return values[0] if answer.negative else bytes(values).decode()


@observes("fault-on-plc-stop", {"fault": True, "no-fault": False})
def fault_on_plc_stop(name: str, behaviour: str) -> object:
    """Whether ZSW1.3 is set while the controller is in STOP."""
    plc = speed_plc(name, behaviour)
    plc.stop_controller()
    return bool(plc.put(STW1=RUN, wait=200) & FAULT)


@observes("parameter-memory", {"kept": 9, "lost": 5})
def parameter_memory(name: str, behaviour: str) -> object:
    """What a written parameter is behind a power cycle."""
    plc = Plc(name, behaviour, 3)
    assert plc.change(TOLERANCE, UNSIGNED16, 9) is None
    assert plc.read(TOLERANCE) == 9
    plc.power_cycle()
    return plc.read(TOLERANCE)


@observes("fault-history", {"kept": True, "lost": False})
def fault_history(name: str, behaviour: str) -> object:
    """Whether the fault buffer has anything behind a power cycle."""
    if name == assembly_points.NAME:
        return assembly_points.fault_history(behaviour)
    plc = Plc(name, behaviour, SPEED[kind(name)])
    number = {"hiwin-e1": 17, "moog-msd": "9-1"}.get(kind(name), 702)
    plc.inject("drive-fault", fault=number)
    plc.wait(20)
    assert plc.put(STW1=0x0480) & FAULT == 0, "acknowledged"
    assert any(plc.buffer())
    plc.power_cycle()
    return any(plc.buffer())


@observes("position-parameters", {"thousandths": 65536, "literal": 66})
def position_parameters(name: str, behaviour: str) -> object:
    """PL.FB a revolution from the home position."""
    plc = Plc(name, behaviour, 1)
    plc.axis.motor.position = 1.0
    plc.run(0.01)
    return plc.read(POSITION)
