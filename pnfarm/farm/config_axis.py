"""Motor and load of the farm file, and what they make of an axis record."""

from __future__ import annotations

from math import pi
from typing import Any

from pydantic import Field, model_validator

from pnfarm.farm.config_issue import problem
from pnfarm.farm.config_section import Section
from pnfarm.farm.config_values import Duration

__all__ = ["Load", "Motor", "apply_axis"]

#: Steps of controllers and motor, ns: 16 kHz, and the engine's own longest.
SHORTEST_STEP_NS = 62_500
LONGEST_STEP_NS = 1_000_000


class Load(Section):
    """What hangs on the shaft; what is behind a gear or a spindle counts as much as the shaft feels of it."""

    inertia: float | None = Field(default=None, gt=0, description="Motor and load, kg m^2; left out, the model's.")
    friction: float | None = Field(default=None, ge=0, description="Dry friction, N m.")
    damping: float | None = Field(default=None, ge=0, description="Viscous friction, N m s/rad.")
    torque: float = Field(default=0.0, description="Torque that the machine puts on the shaft, N m, signed.")
    gear: float = Field(default=1.0, gt=0, description="Revolutions of the motor to one of the load.")
    driven_inertia: float = Field(default=0.0, ge=0, description="Behind the gear, kg m^2, beside `inertia`.")
    pitch: float | None = Field(default=None, gt=0, description="Way of a spindle or belt in one revolution, m.")
    mass: float = Field(default=0.0, ge=0, description="What the spindle or belt moves, kg.")
    force: float = Field(default=0.0, description="Force against forward motion, such as a weight's, N, signed.")

    @model_validator(mode="after")
    def _pitch_is_there(self) -> Load:
        if self.pitch is None and (self.mass or self.force):
            raise problem("has a mass or a force, but no way of a revolution", "`pitch`, in metres, beside it")
        return self

    def referred_inertia(self) -> float:
        """kg m^2 that the shaft feels of all that is behind gear and spindle."""
        way = (self.pitch or 0.0) / (2.0 * pi)
        return (self.driven_inertia + self.mass * way * way) / self.gear**2

    def referred_torque(self) -> float:
        """N m that the machine puts on the shaft."""
        return self.torque + self.force * (self.pitch or 0.0) / (2.0 * pi) / self.gear


class Motor(Section):
    """Motor and amplifier, where they differ from the model's."""

    torque_constant: float | None = Field(default=None, gt=0, description="N m per ampere.")
    peak_current: float | None = Field(default=None, gt=0, description="A; 100 % of the current signals (DRV.IPEAK).")
    continuous_current: float | None = Field(default=None, gt=0, description="A that the motor bears for ever.")
    thermal_time: float | None = Field(default=None, ge=0, description="Thermal time constant, s; 0: it stays cool.")
    velocity_time_constant: float | None = Field(
        default=None, gt=0, description="What the speed controller is tuned for: its closed loop, s."
    )
    current_time_constant: float | None = Field(default=None, ge=0, description="Closed current loop, s.")
    max_velocity: float | None = Field(default=None, gt=0, description="Limit of the velocity command, rpm.")
    overspeed: float | None = Field(default=None, ge=0, description="Shaft speed that is a fault, rpm; 0: none.")
    resistance: float | None = Field(default=None, ge=0, description="Winding of one phase, ohm.")
    inductance: float | None = Field(default=None, ge=0, description="Winding of one phase, H.")
    bus_voltage: float | None = Field(default=None, ge=0, description="DC link, V; 0: voltage limits nothing.")
    braking_resistor: bool = Field(default=True, description="Whether one holds the DC link while the motor brakes.")
    encoder_steps: float | None = Field(default=None, ge=0, description="To one revolution; 0: infinitely many.")
    holding_brake: float | None = Field(default=None, ge=0, description="Torque of the holding brake, N m; 0: none.")
    brake_release: float | None = Field(default=None, ge=0, description="Until it is open, s.")
    brake_apply: float | None = Field(default=None, ge=0, description="Until it holds, s.")
    step_ns: Duration | None = Field(
        default=None,
        alias="step",
        ge=SHORTEST_STEP_NS,
        le=LONGEST_STEP_NS,
        description="Longest step of controllers and motor, 62.5us to 1ms.",
    )


def apply_axis(axis: Any, load: Load, motor: Motor) -> None:
    """What the farm file says of motor and load, over the model's values in ``axis``."""
    for field, value in (
        ("inertia", load.inertia),
        ("friction", load.friction),
        ("damping", load.damping),
        ("torque_constant", motor.torque_constant),
        ("peak_current", motor.peak_current),
        ("continuous_current", motor.continuous_current),
        ("thermal_time", motor.thermal_time),
        ("velocity_time_constant", motor.velocity_time_constant),
        ("current_time_constant", motor.current_time_constant),
        ("max_velocity", motor.max_velocity),
        ("overspeed", motor.overspeed),
        ("winding_resistance", motor.resistance),
        ("winding_inductance", motor.inductance),
        ("bus_nominal", motor.bus_voltage),
        ("encoder_steps", motor.encoder_steps),
        ("holding_brake", motor.holding_brake),
        ("brake_release", motor.brake_release),
        ("brake_apply", motor.brake_apply),
        ("motor_step_ns", motor.step_ns),
    ):
        if value is not None:
            axis[field] = value
    axis.inertia += load.referred_inertia()
    axis.load_torque = load.referred_torque()
    if not motor.braking_resistor:
        axis.bus_brake = 0.0
