"""Fields of the axis record: load, motor, brake."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["BRAKE_RECORD", "LOAD_RECORD", "MOTOR_RECORD"]

LOAD_RECORD = subject(
    "load",
    "The load on the shaft.",
    settings=[
        Field("inertia", "f8", "kg m^2", "station", "motor and load"),
        Field("friction", "f8", "N m", "station", "dry friction, opposes motion"),
        Field("damping", "f8", "N m s/rad", "station", "viscous friction"),
        Field("torque", "f8", "N m", "station", "torque that the machine puts on the shaft"),
        Field("added_inertia", "f8", "kg m^2", "fault", "in addition to inertia, which the drive is tuned for"),
        Field("added_friction", "f8", "N m", "fault", "dry friction in addition to friction"),
        Field("added_torque", "f8", "N m", "fault", "torque on the shaft in addition to torque"),
    ],
)

MOTOR_RECORD = subject(
    "motor",
    "Motor, speed and current controller.",
    settings=[
        Field("torque_constant", "f8", "N m/A", "station", "torque per ampere"),
        Field("peak_current", "f8", "A", "station", "DRV.IPEAK: 100 % of the current signals"),
        Field(
            "continuous_current", "f8", "A", "station", "current that the motor can carry continuously, 0 = unlimited"
        ),
        Field("velocity_time_constant", "f8", "s", "station", "closed velocity loop that the controller is tuned for"),
        Field("max_velocity", "f8", "rpm", "station", "limit of the velocity command"),
        Field("speed_gain", "f8", "N m s/rad", "parameter", "speed controller, 0 = inertia / velocity_time_constant"),
        Field("speed_integral_time", "f8", "s", "parameter", "speed controller, 0 = four times velocity_time_constant"),
        Field(
            "speed_feed_forward", "f8", "", "parameter", "part of a profile's speed that is fed forward", default=1.0
        ),
        Field(
            "acceleration_gain",
            "f8",
            "",
            "parameter",
            "torque feed-forward of profiles, 1 = all that the inertia needs",
        ),
        Field("current_time_constant", "f8", "s", "station", "closed current loop, first order, 0 = at once"),
        Field("resistance", "f8", "ohm", "station", "of one phase"),
        Field("inductance", "f8", "H", "station", "of one phase"),
        Field("thermal_time", "f8", "s", "station", "thermal time constant of the motor, 0 = it stays cool"),
        Field("encoder_steps", "f8", "1/rev", "station", "increments of the encoder, 0 = infinitely many"),
        Field("brake_damping", "f8", "N m s/rad", "station", "dynamic brake of a power stage that is off, 0 = none"),
        Field("coast_method", "u1", "", "parameter", "dynamic brake: 0 always, 1 until standstill, 2 never"),
        Field("step_ns", "i8", "ns", "station", "longest step of controllers and motor, 0 = 1 ms"),
        Field("overspeed", "f8", "rpm", "parameter", "shaft speed that is a fault, 0 = none"),
        Field("overspeed_fault", "u4", "", "parameter", "that fault, number | reaction << 24, 0 = none"),
        Field("overload_fault", "u4", "", "parameter", "fault of a motor that is too hot, coded as overspeed_fault"),
    ],
    state=[
        Field("velocity", "f8", "rpm", "firmware", "shaft speed (VL.FB)"),
        Field("position", "f8", "rev", "firmware", "shaft position since power-on (PL.FB)"),
        Field("current", "f8", "A", "firmware", "torque-building current (IL.FB)"),
        Field("torque", "f8", "N m", "firmware", "motor torque"),
        Field("speed_integral", "f8", "N m", "firmware", "integral part of the speed controller"),
        Field("fed_speed", "f8", "rpm", "firmware", "speed set point of the last step, for the feed-forward"),
        Field("measured_position", "f8", "rev", "firmware", "shaft position as the encoder reports it"),
        Field("encoder_low", "f8", "rev", "firmware", "slow part of the encoder's error"),
        Field("thermal_load", "f8", "", "firmware", "the motor's thermal load, 1 = its limit (I2t)"),
        Field("rested", "u1", "", "firmware", "1 = the axis came to rest since its power stage went off"),
    ],
)

BRAKE_RECORD = subject(
    "brake",
    "The holding brake.",
    settings=[
        Field("torque", "f8", "N m", "station", "torque of the holding brake, 0 = no brake"),
        Field("release", "f8", "s", "station", "time until the holding brake is open"),
        Field("apply", "f8", "s", "station", "time until the holding brake holds"),
    ],
    state=[
        Field("left", "f8", "s", "firmware", "time left until it is in the requested state"),
        Field("asked", "u1", "", "firmware", "1 = the holding brake is commanded to open"),
        Field("open", "u1", "", "firmware", "1 = the holding brake is open"),
    ],
)
