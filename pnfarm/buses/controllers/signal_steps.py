"""Increments of a PROFIdrive drive's signals, as the drive works them out; for controllers on any of its buses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.parameters.given_values import raw_number
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.drives.telegrams.signal_view import signal_units
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.profidrive.tasks import ramp_step
from pnfarm.table.axis_codes import OBJECT_AXIS, TASKS_NONE
from pnfarm.table.image import IMAGE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.config.drive import DriveConfig
    from pnfarm.drives.description.model import Model

__all__ = ["KnownSteps", "SignalSteps", "powered_axis", "signal_steps"]


@dataclass(frozen=True, slots=True)
class SignalSteps:
    """Size of one increment of each set point in the drive, and what its control word is.

    Names as in the axis record.
    """

    velocity_step: float = 1.0
    velocity_step_b: float = 0.0
    object: int = OBJECT_AXIS
    task_form: int = TASKS_NONE
    control_config: int = 0
    moving_bit: int = 0
    target_step: float = 1.0
    task_velocity_step: float = 1.0
    task_acceleration_step: float = 1.0
    task_deceleration_step: float = 1.0
    task_ramps_signed: bool = False
    real_tasks: bool = False
    ramp_step: float = 1.0

    def units(self) -> dict[str, tuple[float, str]]:
        """Increment and unit of each signal of speed and of a target."""
        return signal_units(
            velocity_step=self.velocity_step,
            velocity_step_b=self.velocity_step_b,
            target_step=self.target_step,
            task_velocity_step=self.task_velocity_step,
        )


def powered_axis(model: Model, drive: DriveConfig, *, motor: bool = False) -> Any:
    """An axis record as after power-on, with what the drive works out of its parameters, and of its motor.

    Raises :class:`ConfigError` for a value that a parameter cannot have.
    """
    numbers: dict[str | int, int | Sequence[int]] = {}
    for key, value in drive.params.items():
        raw = raw_number(model.resolve(key)[0], value)
        if raw is None:
            raise ConfigError(f"drive {drive.name}: {key} cannot be {value!r}")
        numbers[key] = raw
    axes, image = AXIS.allocate(1), IMAGE.allocate(1)
    if motor:
        model.apply_motor(axes[0])
    store = ParameterStore(model, AxisHandle(axes[0], image[0]))
    store.commission(numbers)
    store.power_on()
    return axes[0]


def signal_steps(model: Model, drive: DriveConfig, telegram: int) -> SignalSteps:
    """The steps as the drive itself works them out of its parameters and the telegram."""
    axis = powered_axis(model, drive)
    own, jog, ramp = axis.profidrive.settings, axis.jog.settings, axis.ramp.settings
    known = model.profidrive.telegrams.get(telegram)
    speed_up = ramp_step(own.task_acceleration_step, jog.acceleration, ramp.acceleration)
    speed_down = ramp_step(own.task_deceleration_step, jog.deceleration, ramp.deceleration)
    return SignalSteps(
        velocity_step=float(own.velocity_step),
        velocity_step_b=float(own.velocity_step_b),
        object=OBJECT_AXIS if known is None else known.object,
        task_form=TASKS_NONE if known is None else known.tasks,
        control_config=int(axis.asked.settings.control_config),
        moving_bit=int(own.moving_bit),
        target_step=float(own.target_step) or float(axis.travel.settings.position_step),
        task_velocity_step=float(own.task_velocity_step) or 1.0,
        task_acceleration_step=float(speed_up) or 1.0,
        task_deceleration_step=float(speed_down) or 1.0,
        task_ramps_signed=bool(own.task_ramps_signed),
        real_tasks=known is not None and any(one is not None and one.real for one in known.output),
        ramp_step=float(own.acceleration_step) or 1.0,
    )


class KnownSteps:
    """:func:`signal_steps` for many drives: those of a group are the same, and are worked out once."""

    def __init__(self) -> None:
        self._found: dict[tuple[object, ...], tuple[Model, SignalSteps]] = {}

    def of(self, model: Model, drive: DriveConfig, telegram: int) -> SignalSteps:
        """Those of one drive."""
        key = id(model), telegram, *drive.params.items()
        # the model is kept, so that no other one gets its id
        found = self._found.get(key)
        if found is None:
            found = self._found[key] = model, signal_steps(model, drive, telegram)
        return found[1]
