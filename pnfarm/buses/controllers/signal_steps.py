"""Increments of a PROFIdrive drive's signals, as the drive works them out; for controllers on any of its buses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.drives.telegrams.signal_view import signal_units
from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.profidrive.tasks import ramp_step
from pnfarm.table.axis_codes import TASKS_NONE
from pnfarm.table.image import IMAGE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.config.drive import DriveConfig
    from pnfarm.drives.description.model import Model

__all__ = ["KnownSteps", "SignalSteps", "signal_steps"]


@dataclass(frozen=True, slots=True)
class SignalSteps:
    """Size of one increment of each set point in the drive, and how it reads STW1; names as in the axis record."""

    velocity_step: float = 1.0
    velocity_step_b: float = 0.0
    task_form: int = TASKS_NONE
    control_config: int = 0
    target_step: float = 1.0
    task_velocity_step: float = 1.0
    task_acceleration_step: float = 1.0
    task_deceleration_step: float = 1.0
    task_ramps_signed: bool = False
    ramp_step: float = 1.0

    def units(self) -> dict[str, tuple[float, str]]:
        """Increment and unit of each signal of speed and of a target."""
        return signal_units(
            velocity_step=self.velocity_step,
            velocity_step_b=self.velocity_step_b,
            target_step=self.target_step,
            task_velocity_step=self.task_velocity_step,
        )


def signal_steps(model: Model, drive: DriveConfig, telegram: int) -> SignalSteps:
    """The steps as the drive itself works them out of its parameters and the telegram."""
    axes, image = AXIS.allocate(1), IMAGE.allocate(1)
    axis = axes[0]
    store = ParameterStore(model, AxisHandle(axis, image[0]))
    numbers: dict[str | int, int | Sequence[int]] = {
        key: int(value, 0) if isinstance(value, str) else int(value) for key, value in drive.params.items()
    }
    store.commission(numbers)
    store.power_on()
    return SignalSteps(
        velocity_step=float(axis.profidrive.settings.velocity_step),
        velocity_step_b=float(axis.profidrive.settings.velocity_step_b),
        task_form=model.profidrive.telegrams[telegram].tasks if telegram in model.profidrive.telegrams else TASKS_NONE,
        control_config=int(axis.asked.settings.control_config),
        target_step=float(axis.profidrive.settings.target_step) or float(axis.travel.settings.position_step),
        task_velocity_step=float(axis.profidrive.settings.task_velocity_step) or 1.0,
        task_acceleration_step=float(
            ramp_step(
                axis.profidrive.settings.task_acceleration_step,
                axis.jog.settings.acceleration,
                axis.ramp.settings.acceleration,
            )
        )
        or 1.0,
        task_deceleration_step=float(
            ramp_step(
                axis.profidrive.settings.task_deceleration_step,
                axis.jog.settings.deceleration,
                axis.ramp.settings.deceleration,
            )
        )
        or 1.0,
        task_ramps_signed=bool(axis.profidrive.settings.task_ramps_signed),
        ramp_step=float(axis.profidrive.settings.acceleration_step) or 1.0,
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
