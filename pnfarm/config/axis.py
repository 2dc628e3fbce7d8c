"""Motor and load of the farm file, and how they are written into an axis record."""

from __future__ import annotations

from math import pi
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from pnfarm.config.section import Section
from pnfarm.config.values import Duration, between
from pnfarm.drives.description.motor_kinds import axis_value
from pnfarm.firmware.axis import AXIS
from pnfarm.table.axis_codes import FARTHEST, FASTEST_RPM
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

__all__ = ["MOST_PLACE", "Load", "Motor", "apply_axis", "axis_complaints"]

#: Steps of controllers and motor, ns: 16 kHz, and the engine's own longest.
SHORTEST_STEP_NS = 62_500
LONGEST_STEP_NS = 1_000_000
#: Limit of the positions of a machine's parts, revolutions or mm.
MOST_PLACE = 1e6


Step = Annotated[Duration, between(SHORTEST_STEP_NS, LONGEST_STEP_NS, "62.5us to 1ms")]


def _none_or_from(least: float) -> AfterValidator:
    """Zero, which means none, or a number that such a part can have."""

    def check(value: float | None) -> float | None:
        if value is not None and 0.0 < value < least:
            raise Problem(f"is {shown(value)}", f"0, or a number from {least:g} on")
        return value

    return AfterValidator(check)


# Ranges of servo drives, their motors and machines, with room to spare on both sides.  Beyond them an axis is not
# realistic, and its equations lose their precision.
Friction = Annotated[float | None, Field(ge=0, le=1e6)]
Amperes = Annotated[float | None, Field(ge=1e-3, le=1e5)]
BrakeTime = Annotated[float | None, Field(ge=0, le=3600)]
Ohms = Annotated[float | None, Field(ge=0, le=1e4), _none_or_from(1e-6)]
Henries = Annotated[float | None, Field(ge=0, le=100), _none_or_from(1e-9)]
Volts = Annotated[float | None, Field(ge=0, le=1e4), _none_or_from(1.0)]
Steps = Annotated[float | None, Field(ge=0, le=1e12), _none_or_from(1.0)]


class Load(Section):
    """The load on the shaft, or on the forcer of a linear motor; loads behind a gear count as seen by the motor."""

    inertia: float | None = Field(
        default=None, ge=1e-9, le=1e6, description="Motor and load, kg m^2 (linear motor: kg); left out, the model's."
    )
    friction: Friction = Field(default=None, description="Dry friction, N m (linear motor: N).")
    damping: Friction = Field(default=None, description="Viscous friction, N m s/rad (linear motor: N s/m).")
    torque: float = Field(
        default=0.0,
        ge=-1e6,
        le=1e6,
        description="Load torque on the shaft, N m (linear motor: N), signed.",
    )
    gear: float = Field(
        default=1.0, ge=1e-4, le=1e5, description="Revolutions of the motor for one of the driven side."
    )
    driven_inertia: float = Field(
        default=0.0, ge=0, le=1e9, description="Inertia behind the gear, kg m^2, in addition to `inertia`."
    )
    lead: float | None = Field(
        default=None, ge=1e-3, le=1e5, description="Travel of a spindle or belt in one revolution, mm."
    )
    mass: float = Field(
        default=0.0,
        ge=0,
        le=1e6,
        description="Mass moved by spindle, belt or linear motor, in addition to `inertia`, kg.",
    )
    force: float = Field(
        default=0.0, ge=-1e7, le=1e7, description="Force against forward motion, such as a weight's, N, signed."
    )

    def referred_inertia(self, pitch: float) -> float:
        """Inertia behind gear and spindle as seen by the motor, kg m^2; ``pitch`` of a linear motor, mm, else 0."""
        way = self._way(pitch)
        return self.driven_inertia / self.gear**2 + self.mass * way * way

    def referred_torque(self, pitch: float) -> float:
        """Torque of the machine on the motor, N m."""
        return axis_value("load.torque", self.torque, pitch) + self.force * self._way(pitch)

    def revolutions(self, pitch: float) -> float:
        """Motor revolutions per unit of the machine's positions: mm of linear motion, else a turn behind the gear."""
        if pitch > 0.0:
            return 1.0 / pitch
        return self.gear if self.lead is None else self.gear / self.lead

    def _way(self, pitch: float) -> float:
        """Distance by which a radian of the motor moves the mass, m."""
        return (pitch if pitch > 0.0 else (self.lead or 0.0) / self.gear) / 1000.0 / (2.0 * pi)


class Motor(Section):
    """Motor and amplifier, where they differ from the model's."""

    kind: str | None = Field(
        default=None,
        description="rotary, or another kind that `pnfarm models MODEL` shows under MOTORS, such as linear; "
        "left out, the model's default.",
    )
    pitch: float | None = Field(
        default=None,
        ge=0.1,
        le=1e4,
        description="Pitch of a linear motor, mm, which corresponds to a revolution; left out, the model's.",
    )
    torque_constant: float | None = Field(
        default=None, ge=1e-5, le=1e4, description="N m per ampere (linear motor: N)."
    )
    rated_torque: float | None = Field(
        default=None, ge=1e-4, le=1e6, description="N m (linear motor: N); 100 % of torque limits that are percentages."
    )
    peak_current: Amperes = Field(default=None, description="A; 100 % of the current signals (DRV.IPEAK).")
    continuous_current: Amperes = Field(default=None, description="Continuous current, A.")
    thermal_time: float | None = Field(
        default=None,
        ge=0,
        le=1e6,
        description="Thermal time constant, s; 0 for a motor that stays cool, without current foldback.",
    )
    velocity_time_constant: float | None = Field(
        default=None,
        ge=1e-5,
        le=60,
        description="Time constant of the closed speed loop, s, for which the controller is tuned.",
    )
    current_time_constant: float | None = Field(
        default=None, ge=0, le=10, description="Time constant of the closed current loop, s."
    )
    max_velocity: float | None = Field(
        default=None, ge=1e-2, le=1e6, description="Limit of the velocity command, rpm (linear motor: mm/s)."
    )
    resistance: Ohms = Field(default=None, description="Winding of one phase, ohm.")
    inductance: Henries = Field(default=None, description="Winding of one phase, H.")
    bus_voltage: Volts = Field(default=None, description="Voltage of the DC link, V; 0: no limit by voltage.")
    braking_resistor: bool = Field(
        default=True, description="Whether a resistor limits the DC link voltage while the motor brakes."
    )
    encoder_steps: Steps = Field(
        default=None, description="Increments per revolution (linear motor: per mm); 0: infinite resolution."
    )
    holding_brake: Friction = Field(default=None, description="Torque of the holding brake, N m; 0: none.")
    brake_release: BrakeTime = Field(default=None, description="Time until the brake is open, s.")
    brake_apply: BrakeTime = Field(default=None, description="Time until the brake holds, s.")
    step_ns: Step | None = Field(
        default=None, alias="step", description="Longest step of controllers and motor, 62.5us to 1ms."
    )


#: Bounds of values that several keys make together, in the units of the axis record: a linear motor's become
#: revolutions by its pitch, loads behind a gear count as seen by the motor.  Field: lowest, highest, the section that
#: makes it, and its name there.
_TOGETHER: dict[str, tuple[float, float, str, str]] = {
    "load.inertia": (1e-12, 1e6, "load", "inertia"),
    "load.torque": (-1e7, 1e7, "load", "load torque"),
    "motor.max_velocity": (1e-3, FASTEST_RPM, "motor", "max velocity"),
}


def axis_complaints(axis: Any, load: Load, motor: Motor, pitch: float) -> list[tuple[str, str, str]]:
    """Values that the keys make together and no axis can have: section, what is wrong, what is allowed.

    ``axis`` is a record with the model's own values, which is written to.
    """
    apply_axis(axis, load, motor, pitch)
    complaints = []
    for field, (low, high, section, name) in _TOGETHER.items():
        value = float(AXIS.read(axis, field))
        if not low <= value <= high:
            unit = AXIS.fields[field].unit
            what = f"makes the motor's {name} {value:g} {unit}"
            complaints.append((section, what, f"{low:g} to {high:g} {unit} in all"))
    if abs(load.revolutions(pitch)) * MOST_PLACE > FARTHEST:
        what = f"makes {load.revolutions(pitch):g} revolutions of the motor to one unit of the machine"
        complaints.append(("load", what, f"at most {FARTHEST / MOST_PLACE:g}"))
    return complaints


def apply_axis(axis: Any, load: Load, motor: Motor, pitch: float) -> None:
    """Write motor and load of the farm file over the model's values in ``axis``.

    ``pitch``: of a linear motor, mm, else 0.
    """
    for field, value in (
        ("load.inertia", load.inertia),
        ("load.friction", load.friction),
        ("load.damping", load.damping),
        ("motor.torque_constant", motor.torque_constant),
        ("torque.rated", motor.rated_torque),
        ("motor.peak_current", motor.peak_current),
        ("motor.continuous_current", motor.continuous_current),
        ("motor.thermal_time", motor.thermal_time),
        ("motor.velocity_time_constant", motor.velocity_time_constant),
        ("motor.current_time_constant", motor.current_time_constant),
        ("motor.max_velocity", motor.max_velocity),
        ("motor.resistance", motor.resistance),
        ("motor.inductance", motor.inductance),
        ("supply.nominal", motor.bus_voltage),
        ("motor.encoder_steps", motor.encoder_steps),
        ("brake.torque", motor.holding_brake),
        ("brake.release", motor.brake_release),
        ("brake.apply", motor.brake_apply),
        ("motor.step_ns", motor.step_ns),
    ):
        if value is not None:
            AXIS.write(axis, field, axis_value(field, value, pitch))
    axis.load.settings.inertia += load.referred_inertia(pitch)
    axis.load.settings.torque = load.referred_torque(pitch)
    if not motor.braking_resistor:
        axis.supply.settings.brake = 0.0
