"""Command parameters that the firmware carries out: the code of each, and when a drive accepts it.

As in the Kollmorgen AKD (PROFINET manual 5.6, 5.10.3; its parameter reference).  Only the control word enables the
drive and gives velocity set points; these commands start and end everything else.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.axis_handle import CommandRingFullError
from pnfarm.drives.parameters.parameter import Parameter, ParameterErrorNumber, refusal
from pnfarm.table.axis_codes import (
    CMD_ACKNOWLEDGE,
    CMD_CONTINUE,
    CMD_DISABLE,
    CMD_HOME,
    CMD_SERVICE,
    CMD_SET_POSITION,
    CMD_START_TASK,
    CMD_STOP,
    MOTION_HALTED,
    SERVICE_ALTERNATING,
    SERVICE_CONSTANT,
    STOP_HALT,
)

if TYPE_CHECKING:
    from pnfarm.drives.axis_handle import AxisHandle

__all__ = ["AXIS_COMMANDS", "command_axis"]

#: DRV.OPMODE.
VELOCITY_MODE, POSITION_MODE = 1, 2
#: ``command:<name>`` -> code for the firmware, None for no code.
AXIS_COMMANDS = {
    "acknowledge": CMD_ACKNOWLEDGE,
    "set-position": CMD_SET_POSITION,
    "home": CMD_HOME,
    "task-move": CMD_START_TASK,
    "task-continue": CMD_CONTINUE,
    "enable": None,
    "disable": CMD_DISABLE,
    "service": CMD_SERVICE,
    "stop": CMD_STOP,
}


def command_axis(handle: AxisHandle, parameter: Parameter, value: int) -> None:
    """Pass the command of ``parameter`` to the firmware; raises :class:`ParameterError` if the drive cannot accept it.

    A drive that is off has nothing to disable or to stop.
    """
    name = parameter.argument
    command = AXIS_COMMANDS[name]
    if not _allowed(handle, name):
        raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter)
    if command is None or (name in {"disable", "stop"} and not handle.in_operation):
        return
    argument = {"task-move": value, "stop": STOP_HALT}.get(name, 0)
    try:
        handle.push_command(command, argument)
    except CommandRingFullError as exc:
        raise refusal(ParameterErrorNumber.OPERATING_STATE, parameter) from exc


def _allowed(handle: AxisHandle, name: str) -> bool:
    axis, running = handle.axis, handle.in_operation
    positions = int(axis.drive.settings.opmode) == POSITION_MODE
    match name:
        case "enable":
            return running
        case "home" | "task-move":
            return running and positions
        case "task-continue":
            return int(axis.positioning.state) == MOTION_HALTED
        case "stop":
            return not running or positions or bool(axis.service.leg)
        case "service":
            turns = int(axis.service.settings.mode) in {SERVICE_CONSTANT, SERVICE_ALTERNATING}
            return (
                running
                and turns
                and int(axis.drive.settings.opmode) == VELOCITY_MODE
                and bool(axis.drive.settings.setpoint_ignored)
            )
        case _:
            return True
