"""Tasks of the drive's front that need the parameter store: taken from the engine's events, answered in the image.

:mod:`pnfarm.firmware.ethernetip.tasks` has their form.  The answer is whole when ``image.parameter_answered`` names its
task, which is therefore written last.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.ethernetip.device.objects.position_controller import ONLY
from pnfarm.drives.motion_tasks import MotionTask
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.firmware.ethernetip.maps import COMMAND_SIZES, DYNAMIC
from pnfarm.firmware.ethernetip.tasks import TASK_ATTRIBUTE, TASK_MAP, TASK_MOVE, TASK_PARAMETER
from pnfarm.protocols.enip.object import SUCCESS, Answer, refused
from pnfarm.protocols.enip.status import GeneralStatus
from pnfarm.table.axis_codes import TASK_MDI
from pnfarm.table.signals import ASSEMBLY, ASSEMBLY_WORDS

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.ethernetip.device.objects.parameter_object import ParameterObject
    from pnfarm.buses.ethernetip.device.objects.position_controller import PositionController
    from pnfarm.buses.ethernetip.device.objects.values import CipValues
    from pnfarm.drives.parameters.store import ParameterStore

__all__ = ["FrontTasks"]

#: Additional code of every error that has no other (6.2.3.5).
ADDITIONAL = 0xFF
#: Octets of data in the assembly.
DATA = 8
LIMITS = {383: "SWLS.EN", 384: "SWLS.LIMIT0", 386: "SWLS.LIMIT1"}


class FrontTasks:
    """One drive's; ``latency`` gives the processing time of an explicit command, ns, None for no time."""

    def __init__(
        self,
        store: ParameterStore,
        values: CipValues,
        parameters: ParameterObject,
        controller: PositionController,
        latency: Callable[[], int] | None = None,
    ) -> None:
        self._store = store
        self._values = values
        self._parameters = parameters
        self._controller = controller
        self._latency = latency
        self._image = store.handle.image
        self._own = store.handle.axis.ethernetip
        self._working: tuple[int, int] | None = None
        self.reset()

    def reset(self) -> None:
        """The drive was switched on: no task is pending."""
        self._working = None
        self._image.parameter_answered = self._image.parameter_task

    def next_deadline(self) -> int | None:
        """When the pending task is to be carried out."""
        return None if self._working is None else self._working[0]

    def handle_timeout(self, now: int) -> None:
        """Carry out the pending task when it is due."""
        if self._working is not None and self._working[0] <= now:
            _, task = self._working
            self._working = None
            self._carry_out(task)

    def take(self, task: int, now: int) -> None:
        """A task that the engine reports; one that is answered already or at work is left alone."""
        if self._working is not None or task == int(self._image.parameter_answered):
            return
        explicit = task >> 24 & 0xFF in {TASK_ATTRIBUTE, TASK_PARAMETER}
        latency = self._latency() if explicit and self._latency is not None else 0
        if latency > 0:
            self._working = (now + latency, task)
        else:
            self._carry_out(task)

    def _carry_out(self, task: int) -> None:
        kind, write, number = task >> 24 & 0xFF, bool(task >> 16 & 1), task & 0xFFFF
        data = (int(self._own.task_value) & (1 << 8 * DATA) - 1).to_bytes(DATA, "little")
        value = 0
        if kind == TASK_ATTRIBUTE:
            answer = self._controller.set(ONLY, number, data[: self._controller.size(number)])
        elif kind == TASK_PARAMETER and write:
            row = self._store.model.cip.instances.get(number)
            answer = self._parameters.set(number, 1, data[: row.size if row else DATA])
        elif kind == TASK_PARAMETER:
            answer, value = self._read(number)
        elif kind == TASK_MAP:
            answer = self._map()
        elif kind == TASK_MOVE:
            answer = self._keep_move()
        else:
            answer = refused(GeneralStatus.SERVICE_NOT_SUPPORTED)
        self._own.settings.answer_status = 0 if answer.ok else answer.status | ADDITIONAL << 8
        self._image.parameter_answer = value
        self._image.parameter_answered = task

    def _read(self, number: int) -> tuple[Answer, int]:
        """A parameter's value as eight octets; without a sign their highest bit is not one."""
        answer = self._parameters.get(number, 1)
        if not answer.ok:
            return answer, 0
        signed = self._store.model.cip.instances[number].signed or len(answer.data) == DATA
        return answer, int.from_bytes(answer.data, "little", signed=signed)

    def _map(self) -> Answer:
        """Write the mapped set points (EIP.CMDMAP) that differ from what is in force; a refused one stops no other."""
        words = self._image.received[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS]
        octets = words.astype("<i4").tobytes()
        place = DYNAMIC
        answer = SUCCESS
        for entry in self._own.settings.command_map:
            size = COMMAND_SIZES.get(int(entry), 0)
            if size == 0 or place + size > len(octets):
                continue
            number = self._values.named(LIMITS[int(entry)])
            signed = self._store.model.cip.instances[number].signed
            value = int.from_bytes(octets[place : place + size], "little", signed=signed)
            place += size
            try:
                if self._values.read(number) != value:
                    self._values.write(number, value)
            except ParameterError:
                answer = refused(GeneralStatus.INVALID_ATTRIBUTE_VALUE)
        return answer

    def _keep_move(self) -> Answer:
        """A position move is motion task 0 (6.2.2.4), where MT.LOAD finds it."""
        asked = self._store.handle.axis.asked
        if int(asked.number) == TASK_MDI and not int(asked.endless):
            self._store.keep_task(
                MotionTask(
                    0,
                    float(asked.position),
                    float(asked.velocity),
                    float(asked.acceleration),
                    float(asked.deceleration),
                    relative=bool(asked.relative),
                )
            )
        return SUCCESS
