"""Parameters computed from the drive: identification, lists, fault buffer, states.

Each function takes the drive and the parameter's row and gives all elements (one for a plain parameter).  The names are
those of ``computed:<name>`` in a model's ``parameters.csv``; a trailing number there is ``parameter.index``.
"""

from __future__ import annotations

from math import inf, isfinite
from types import FunctionType
from typing import TYPE_CHECKING, Protocol

from pnfarm.drives.parameters.factor_group import float_bits
from pnfarm.drives.parameters.measured import deviation
from pnfarm.drives.profiles.profidrive.fault_buffer import active_faults, fault_numbers
from pnfarm.drives.profiles.profidrive.fault_buffer import fault_counter as situations
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import (
    FAULT_SITUATIONS,
    FAULT_SLOTS,
    LACKS_ENABLE,
    LACKS_RELEASE,
    LACKS_SUPPLY,
    LIFE_GOOD,
    RAMP_GENERATED,
)
from pnfarm.table.image import LOST_EXPIRED, LOST_NEVER, LOST_STOP
from pnfarm.table.signals import DRIVE_INPUTS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.drives.axis_handle import AxisHandle
    from pnfarm.drives.description.model import Model
    from pnfarm.drives.parameters.network import Network
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["COMPUTED", "CONSTANT_COMPUTED"]

#: ChannelErrorType of the profile's first fault class, and of its other faults (Moog MSD manual, table 9.23).
FIRST_CLASS = 0x9000
OTHER_FAULT = 0x9012
#: PNU 980..989 do not list themselves (profile 4.1, 6.2.1.2).
LISTS = range(980, 990)
#: Bits of P-0953: the cyclic data timed out, the controller is in STOP or marks its data BAD (Moog MSD manual, table
#: 15.1, which gives no bit numbers: assumed in its order); too many signs of life failed (8.3.2).
TIMEOUT_WARNING = 0x0001
STOP_WARNING = 0x0002
LIFE_WARNING = 0x0010
#: PNU 979: version 1.1 of its structure, one encoder, five values for it; bits for "valid" and for a linear encoder.
ENCODER_HEADER = 0x5111
ENCODER_TYPE = 0x80000000
ENCODER_LINEAR = 0x00000001
#: Revolutions of an absolute multi-turn encoder: a usual one has 12 bits.
EVERY_REVOLUTION = 4096
#: r0002 in S5 by ``drive.stop``: ramp stop, quick stop, fault.
_BRAKING = {1: 16, 2: 17, 3: 18}
#: ``opmode``.
VELOCITY_MODE = 1


class DriveView(Protocol):
    """What these functions read of a drive: its :class:`~pnfarm.drives.parameters.store.ParameterStore`."""

    model: Model
    handle: AxisHandle
    network: Network
    watchdog_ns: int

    @property
    def telegram_number(self) -> int:
        """Number of the telegram in force."""

    @property
    def waiting_name(self) -> bytes | None:
        """A station name that waits for the next power-on."""

    def mapped_numbers(self, *, setpoint: bool) -> tuple[int, ...]:
        """The signal numbers of one direction, word by word."""

    def changed_numbers(self) -> list[int]:
        """The PNUs of values that differ from the model's defaults."""

    def scaled(self, parameter: Parameter, physical: float) -> int:
        """A physical value as the parameter's raw number."""


def _fill(values: Sequence[int], parameter: Parameter) -> Sequence[int]:
    """``values`` with zeros up to the array's length."""
    return list(values) + [0] * (parameter.elements - len(values))


def setpoint_mapping(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    return _fill(drive.mapped_numbers(setpoint=True), parameter)


def actual_mapping(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    return _fill(drive.mapped_numbers(setpoint=False), parameter)


def telegram(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    return [drive.telegram_number]


def signal_list(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """PNU 923: at a signal's number the PNU that reads it; every signal with a PNU has its own number."""
    parameters = drive.model.parameters
    return [
        number if number in drive.model.profidrive.signals and number in parameters else 0
        for number in range(parameter.elements)
    ]


def fault_counter(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    return [situations(drive.handle.axis)]


def kept_situations(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """PNU 952 of a drive with a non-volatile fault buffer: the stored count plus the faults since power-on."""
    axis = drive.handle.axis
    return [int(axis.faults.kept) + situations(axis) & 0xFFFF]


def fault_buffer(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """PNU 947; in two parts: error in the low word, location in the high one (Moog MSD manual 10.9, P-0949)."""
    return [parameter.clamp(number) for number in fault_numbers(drive.handle.axis)[: parameter.elements]]


def fault_changes(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    return [int(drive.handle.axis.faults.changes)]


def fault_codes(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """PNU 945: the fault buffer in the manual's codes."""
    faults = drive.model.faults
    return [faults[number].word if number in faults else 0 for number in fault_numbers(drive.handle.axis)]


def fault_scaling(_drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """PNU 950: situations, and faults of one situation."""
    return [FAULT_SITUATIONS, FAULT_SLOTS]


def operation_mode(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """PNU 930 by the profile: 1 speed with ramp generator, 2 position, 3 speed without; 0 for torque, not defined."""
    axis = drive.handle.axis
    if int(axis.drive.settings.opmode) != VELOCITY_MODE:
        return [int(axis.drive.settings.opmode)]
    return [1 if int(axis.ramp.settings.generator) == RAMP_GENERATED else 3]


def encoder_format(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """PNU 979 (profile 4.1, 6.3.4): header, then type, resolution, two shift factors and revolutions of encoder 1.

    The resolution is increments per revolution; for a linear encoder it is nm per increment, without revolutions.  A
    drive without a sensor interface reports the steps of its motor's encoder.
    """
    axis, pitch = drive.handle.axis, drive.model.pitch
    # one that keeps the home position without power is absolute
    turns = inf if axis.homing.settings.stays else float(axis.sensor.settings.revolutions)
    step = float(axis.sensor.settings.step) or (
        1.0 / float(axis.motor.settings.encoder_steps) if axis.motor.settings.encoder_steps else 0.0
    )
    if pitch > 0.0:
        return _fill([ENCODER_HEADER, ENCODER_TYPE | ENCODER_LINEAR, round(step * pitch * 1e6)], parameter)
    known = round(turns) if isfinite(turns) else EVERY_REVOLUTION
    return _fill([ENCODER_HEADER, ENCODER_TYPE, round(1.0 / step) if step else 0, 0, 0, known], parameter)


def _firmware(model: Model) -> tuple[int, int, int]:
    """Version as decimal xxyy, year, day and month as decimal ddmm (HIWIN E1 manual, PNU 964)."""
    major, minor, _ = model.profidrive.identity.software_version
    return (major * 100 + minor, *model.profidrive.identity.firmware_date)


def unit_identification(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """PNU 964: manufacturer, drive unit type, version, year, day and month, drive objects, minor version."""
    identity = drive.model.profidrive.identity
    minor = identity.software_version[2]
    return [identity.vendor_id, identity.drive_unit_type, *_firmware(drive.model), 1, minor][: parameter.elements]


def object_identification(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """PNU 975: as 964, then class, application classes and number of the drive object."""
    identity = drive.model.profidrive.identity
    known = [identity.vendor_id, identity.drive_unit_type, *_firmware(drive.model), *identity.object_class]
    return _fill(known, parameter)


def parameter_list(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """PNU 980 + index: defined parameters in ascending order; each list but the last ends with the next list's PNU."""
    size = parameter.elements - 1
    numbers = [pnu for pnu in drive.model.parameters if pnu not in LISTS]
    part = numbers[size * parameter.index : size * (parameter.index + 1)]
    if len(numbers) > size * (parameter.index + 1):
        return [*part, LISTS[parameter.index + 1]]
    return _fill(part, parameter)


def signals(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """The numbers of all signals that a free mapping may name (Moog MSD manual, table 14.5, P-0923)."""
    return _fill(sorted(n for n, signal in drive.model.profidrive.signals.items() if not signal.shown_as), parameter)


def setpoint_signals(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    signals = drive.model.profidrive.signals.items()
    return _fill(sorted(n for n, signal in signals if signal.setpoint and not signal.shown_as), parameter)


def actual_signals(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    signals = drive.model.profidrive.signals.items()
    sent = (n for n, signal in signals if (not signal.setpoint or signal.readable) and not signal.shown_as)
    return _fill(sorted(sent), parameter)


def changed_list(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """PNU 990: parameters that differ from the factory values, as many as fit."""
    return _fill(drive.changed_numbers()[: parameter.elements], parameter)


def fault_classes(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """The newest faults by the profile's classes: indexes into the list of P-0951 (Moog MSD manual, table 10.22).

    A fault's class is its ChannelErrorType - 0x9000 + 1; a fault without a type belongs to "other".
    """
    diagnoses = drive.model.diagnoses
    return [
        min(diagnoses.get(number, OTHER_FAULT) - FIRST_CLASS + 1, OTHER_FAULT - FIRST_CLASS + 1) if number else 0
        for number in fault_numbers(drive.handle.axis)[: parameter.elements]
    ]


def fault(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """One of the active faults, oldest first; 0 for none."""
    active = active_faults(drive.handle.axis)
    return [active[parameter.index] if parameter.index < len(active) else 0]


def warning(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """One of the active warnings, the first of which the warning word shows; 0 for none."""
    return [int(drive.handle.axis.warnings.active[parameter.index])]


def warning_numbers(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """All active warnings."""
    return _fill([int(number) for number in drive.handle.axis.warnings.active if number], parameter)


def operating_display(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """r0002 of SINAMICS drives: what operation waits for, of several the highest number."""
    axis = drive.handle.axis
    state, word = int(axis.drive.state), int(axis.profidrive.stw1)
    waits: tuple[tuple[int, bool], ...]
    if state == 1:
        waits = (
            (45, bool(axis.faults.code[0])), (44, bool(int(axis.drive.lacks) & LACKS_ENABLE)), (43, not word & 0x0004),
            (42, not word & 0x0002), (41, True),
        )  # fmt: skip
    elif state == 4:
        waits = ((13, not word & 0x0010), (12, not word & 0x0020), (10, not word & 0x0040), (0, True))
    else:
        waits = (({0: 70, 2: 31, 3: 21, 5: _BRAKING.get(int(axis.drive.stop), 16)}[state], True),)
    return [next(number for number, waiting in waits if waiting)]


def bus_warnings(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """P-0953: each stays until cyclic data begin again (Moog MSD manual 8.3.2 says so of the sign of life)."""
    axis, lost = drive.handle.axis, int(drive.handle.image.lost)
    # the drive's own watchdog may expire while the connection still exists, or after it ended
    late = lost != LOST_NEVER and int(axis.faults.settings.loss_delay_ns) > 0 and int(axis.profidrive.telegram_ns) == 0
    word = LIFE_WARNING if int(axis.life.failed) != LIFE_GOOD else 0
    word |= TIMEOUT_WARNING if late or lost == LOST_EXPIRED else 0
    return [word | (STOP_WARNING if lost == LOST_STOP else 0)]


def active(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    return [int(drive.handle.in_operation)]


def software_limits(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """Bits 0 and 1 of DRIVE_INPUTS (AKD PROFINET manual 5.8.1)."""
    return [int(drive.handle.image.sent[DRIVE_INPUTS]) & 0x3]


def limit_switch(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """One of the two: 0 the negative, 1 the positive."""
    return [int(drive.handle.axis.machine.limit_switch) >> parameter.index & 1]


def controlled_stop(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    axis = drive.handle.axis
    return [int(int(axis.drive.state) == 5 and int(axis.drive.stop) in {2, 3})]


def disable_sources(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """DRV.DISSOURCES (AKD parameter reference): what keeps the power stage off, or requests switching it off.

    Bit 0 software, 1 fault, 2 hardware, 3 no power supply, 4 still starting up, 5 an input for a controlled stop.
    """
    axis = drive.handle.axis
    lacks = int(axis.drive.lacks)
    reasons = (
        not drive.handle.in_operation,
        int(axis.faults.code[0]) != 0,
        lacks & LACKS_ENABLE,
        lacks & LACKS_SUPPLY,
        int(axis.drive.state) == 0,
        lacks & LACKS_RELEASE,
    )
    return [sum(1 << bit for bit, there in enumerate(reasons) if there)]


def hardware_enable(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """DRV.HWENABLE (AKD parameter reference): 1 while the hardware enables the drive."""
    return [int(not int(drive.handle.axis.drive.lacks) & LACKS_ENABLE)]


def digital_input(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """The level of one input, the first is 0."""
    return [int(drive.handle.axis.machine.inputs) >> parameter.index & 1]


def digital_inputs(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """The levels of all inputs, the first is bit 0."""
    return [int(drive.handle.axis.machine.inputs) & 0x7F]


def drive_status(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """STATUS3: active, torque allowed, positive and negative limit switch, the same of software limits, from bit 0."""
    (limits,) = software_limits(drive, parameter)
    switch = int(drive.handle.axis.machine.limit_switch)
    bits = (
        drive.handle.in_operation,
        torque_allowed(drive, parameter)[0],
        switch & 0x2,
        switch & 0x1,
        limits & 0x2,
        limits & 0x1,
    )
    return [sum(1 << bit for bit, there in enumerate(bits) if there)]


def connected(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """Whether a controller sends set points, or is in STOP."""
    return [int(drive.handle.controlled or int(drive.handle.image.lost) == LOST_STOP)]


def torque_allowed(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """STO.STATE: bit 6 of DRIVE_INPUTS (AKD PROFINET manual 5.8.1)."""
    return [int(drive.handle.image.sent[DRIVE_INPUTS]) >> 6 & 1]


def _measured(drive: DriveView, field: str) -> float:
    """A field of the axis record as the drive measures it."""
    axis = drive.handle.axis
    return float(AXIS.read(axis, field)) + deviation(axis, field)


def mechanical_position(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """FB1.MECHPOS (AKD parameter reference): the angle of the shaft, 2^32 per revolution."""
    return [int(_measured(drive, "motor.position") % 1.0 * 2**32) & 0xFFFFFFFF]


def shaft_position(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """The feedback's own position, which no homing moves."""
    return [drive.scaled(parameter, _measured(drive, "motor.position"))]


def velocity_error(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    return [drive.scaled(parameter, float(drive.handle.axis.ramp.command) - _measured(drive, "motor.velocity"))]


def position_difference(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """The following error in position units, as a float32 (Moog MSD manual, table 10.14, P-0414)."""
    return [
        float_bits(
            _measured(drive, "positioning.following_error") / float(drive.handle.axis.travel.settings.position_step)
        )
    ]


def speed_difference(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """The input of the speed controller, in speed units, as a float32 (table 10.13, P-0417)."""
    axis = drive.handle.axis
    return [
        float_bits(
            (float(axis.ramp.reference) - _measured(drive, "motor.velocity"))
            / float(axis.profidrive.settings.velocity_step)
        )
    ]


def foldback_level(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """IL.FOLDFTHRESH (AKD parameter reference): the written value, limited to the peak current."""
    axis = drive.handle.axis
    return [
        drive.scaled(parameter, min(float(axis.motor.settings.peak_current), float(axis.foldback.settings.fault_level)))
    ]


def foldback_recovery(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """IL.MFOLDR: time without current until peak current is available for IL.MFOLDD again (`firmware.foldback`)."""
    axis = drive.handle.axis
    if not axis.motor.settings.continuous_current:
        return [0]
    times = float(axis.foldback.settings.delay[0]) + float(axis.foldback.settings.time[0])
    return [
        drive.scaled(
            parameter,
            times * (float(axis.motor.settings.peak_current) / float(axis.motor.settings.continuous_current) - 1.0),
        )
    ]


def timeout(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    return [drive.watchdog_ns // 1_000_000]


def station_name(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """P-1289: a written name that takes effect at the next power-on, else the present station name."""
    waiting = drive.waiting_name
    name = drive.network.name.encode("ascii", "replace") if waiting is None else waiting
    return _fill(list(name[: parameter.elements]), parameter) if name else parameter.defaults


def name_of_station(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """PNU 61000 of PROFIdrive on PROFINET: the name in force."""
    return _fill(list(drive.network.name.encode("ascii", "replace")[: parameter.elements]), parameter)


def station_ip(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    return [drive.network.ip]


def station_mask(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    return [drive.network.mask]


def station_gateway(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    return [drive.network.gateway]


def station_macs(drive: DriveView, parameter: Parameter) -> Sequence[int]:
    """P-1292: the station's address, then those of its ports."""
    return _fill(b"".join(drive.network.macs)[: parameter.elements], parameter)


def line_rate(drive: DriveView, _parameter: Parameter) -> Sequence[int]:
    """P-0963: the rate of a serial line, by its code."""
    return [drive.network.line_rate]


fault_situations = fault_counter

#: ``computed:<name>`` -> function: those of this module whose names begin with a letter.
COMPUTED: dict[str, Callable[[DriveView, Parameter], Sequence[int]]] = {
    name.replace("_", "-"): function
    for name, function in list(globals().items())
    if isinstance(function, FunctionType) and function.__module__ == __name__ and not name.startswith("_")
}

#: Those that are constant for one drive: identification, lists, properties of the hardware.
CONSTANT_COMPUTED = frozenset({
    "actual-signals", "encoder-format", "fault-scaling", "foldback-recovery", "object-identification", "parameter-list",
    "setpoint-signals", "signal-list", "signals", "station-macs", "unit-identification",
})  # fmt: skip
