"""The master without a clock and without tasks: slaves, cyclic data, programs; a :class:`Node` like a farm.

The axis programs run in the engine's table, as with any controller; the polls take their words out of its process
images, and put the slaves' in.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.buses.controllers.core import DriveCore
from pnfarm.buses.controllers.snapshot import axis_part, reaction_part
from pnfarm.buses.profibus.controller import events as happened
from pnfarm.buses.profibus.controller.asker import ParameterQuestion
from pnfarm.buses.profibus.controller.line_question import StationParameter, addressed
from pnfarm.buses.profibus.controller.parameters import ParameterJob
from pnfarm.buses.profibus.controller.records import RecordJob
from pnfarm.buses.profibus.device.image import CyclicImage
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.errors import ConfigError, DecodeError
from pnfarm.protocols.profibus.master import Master
from pnfarm.protocols.profibus.master_slaves import ConnectionMade, ConnectionMissed, DiagnosisRead
from pnfarm.protocols.profibus.record_request import RecordRequest
from pnfarm.protocols.profibus.wire.dp import StationStatus
from pnfarm.protocols.profibus.wire.dpv1 import MOST_USER_DATA
from pnfarm.protocols.profibus.wire.telegram import parse_telegram
from pnfarm.table.image import LOST_EXPIRED

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.buses.controller import ControllerHost
    from pnfarm.buses.line_parameters import LineQuestion
    from pnfarm.buses.profibus.controller.plan import DevicePlan, ProfibusPlan
    from pnfarm.protocols.profibus.master_slaves import MasterEvent

__all__ = ["ProfibusCore"]

#: Of a record of DP-V1, in one octet.
HIGHEST_INDEX = 0xFF


class ProfibusCore(DriveCore):
    """See the module's docstring."""

    def __init__(self, plan: ProfibusPlan, host: ControllerHost) -> None:
        without_axes = [device for device in plan.devices if device.described is None]
        super().__init__(plan, host, channels=8, pieces=len(without_axes))
        self.plan = plan
        baud = host.port.baud or plan.settings.baud
        self.master = Master(replace(plan.settings, baud=baud), [device.slave for device in plan.devices])
        self._images: list[CyclicImage] = []
        for index, device in enumerate(plan.devices):
            image = CyclicImage(self.columns.image[index])
            image.layout(device.input_words, device.output_words)
            self._images.append(image)
            station = self.master.stations[index]
            station.source = image.fill if device.described is not None else self._plain(index, device)
        self._jobs: list[tuple[str, ParameterJob | ParameterQuestion | RecordJob]] = []
        self._began_ns: dict[str, int] = {}
        self._reference = 0

    def _plain(self, place: int, device: DevicePlan) -> Callable[[], bytes]:
        """Rows of a device without axes; what gives its outputs."""
        slave = device.slave
        outputs = self._add_plain(place, (slave.output_octets, 0), (slave.input_octets, 1))
        outputs.write({0: device.outputs})
        return outputs.read

    def start(self, now: int) -> None:
        """Begin to poll."""
        self._began_ns = dict.fromkeys(self._places, now)
        self._go_on(now)

    # -- node --------------------------------------------------------------------------------------------------------

    def receive(self, port: int, frame: bytes, now: int) -> None:
        """One telegram of the line."""
        del port
        try:
            telegram = parse_telegram(frame)
        except DecodeError as exc:
            self.dropped[exc.reason] += 1
            self.master.broken(1)
            return
        self.master.receive(telegram, now)
        self._go_on(now)

    def service(self, now: int) -> None:
        self.drain(now)
        self._go_on(now)

    def next_deadline(self) -> int | None:
        return self.master.next_deadline()

    def _go_on(self, now: int) -> None:
        """Take what came, and send what is to be sent."""
        master = self.master
        master.handle_timeout(now)
        while (octets := master.to_send()) is not None:
            self.link.send(self.port.index, octets)
            master.sent(now)
            master.handle_timeout(now)
        for station in master.take_fresh():
            place = self._places[station.plan.name]
            if self.plan.devices[place].described is None:
                self._images[place].note(now)
                self.plain[station.plan.name][1].take(station.inputs, good=True)
            else:
                self._images[place].take(station.inputs, now)
            self._images[place].count(now)
        for event in master.take_events():
            self._take(event, now)
        busy: set[str] = set()
        for job in list(self._jobs):
            name, work = job
            if name in busy:
                # a drive has one answer at a time
                continue
            work.advance(partial(self.master.ask, name, now=now), now)
            if work.done:
                self._jobs.remove(job)
            else:
                busy.add(name)

    def _take(self, event: MasterEvent, now: int) -> None:
        name = event.name
        place = self._places[name]
        match event:
            case ConnectionMade():
                self._images[place].begin()
                address = self.plan.devices[place].slave.address
                self.log.record(now, name, happened.Connected(now - self._began_ns[name], address))
            case ConnectionMissed(why=why, exchanged=exchanged):
                if exchanged:
                    self._images[place].stop(LOST_EXPIRED)
                    if name in self.plain:
                        inputs = self.plain[name][1]
                        inputs.take(inputs.read(), good=False)
                    self._began_ns[name] = now
                self.log.record(now, name, happened.ConnectionBroken(why) if exchanged else happened.ConnectFailed(why))
            case DiagnosisRead(diagnosis=diagnosis):
                status = tuple(bit.name.lower() for bit in StationStatus if diagnosis.status & bit)
                self.log.record(now, name, happened.DiagnosisRead(status, diagnosis.extended.hex(" ")))
            case _:
                pass

    # -- what the owner does -----------------------------------------------------------------------------------------

    def release(self, now: int) -> None:
        """Release every slave."""
        self.master.release()
        self._go_on(now)

    @property
    def all_stopped(self) -> bool:
        return self.master.all_stopped

    @property
    def all_connected(self) -> bool:
        """Every slave exchanges data both ways."""
        return all(
            station.exchanging and bool(self.columns.image[index].valid)
            for index, station in enumerate(self.master.stations)
        )

    def image_of(self, place: int) -> CyclicImage:
        """The words of a slave, by its place in the plan."""
        return self._images[place]

    def inputs_of(self, name: str) -> bytes:
        """The inputs that came last; empty before, and where a slave is lost."""
        return self.master.stations[self._place(name)].inputs

    def snapshot(self) -> list[dict[str, Any]]:
        """One dict for each slave, for the terminal and for JSON."""
        return [self._row(index, device) for index, device in enumerate(self.plan.devices)]

    def _row(self, index: int, device: DevicePlan) -> dict[str, Any]:
        row, station = self.columns.program[index], self.master.stations[index]
        access = station.connection
        address, state = str(device.slave.address), station.state.value
        return {
            **axis_part(device, row, mac="", ip=address, state=state),
            "connects": station.connects,
            "losses": station.losses,
            "retries": station.retries,
            **reaction_part(row),
            "cycle_seconds": max(self.master.cycle_ns, device.cycle_ns) / 1e9,
            "frames_sent": station.polls,
            "frames_received": station.answers,
            "requests_answered": access.answered_requests,
            "requests_failed": access.failed,
            "unusable": [],
            "identification": None,
            "last_reason": station.reason,
        }

    # -- parameters --------------------------------------------------------------------------------------------------

    def read_parameter(self, name: str, parameter: str | int, now: int) -> ParameterJob:
        """A parameter of a drive by name or number; the answer is in what is returned, once that is ``done``.

        Raises :class:`ConfigError` for an unknown drive or parameter.
        """
        return self._begin_job(name, parameter, None, now)

    def write_parameter(self, name: str, parameter: str | int, value: int, now: int) -> ParameterJob:
        """Write a parameter, a whole number as on the wire; raises as :meth:`read_parameter` does."""
        return self._begin_job(name, parameter, value, now)

    def _begin_job(self, name: str, parameter: str | int, value: int | None, now: int) -> ParameterJob:
        described = self.plan.devices[self._place(name)].described
        if described is None:
            raise ConfigError(f"{name} is described by a GSD file, which has no parameters")
        try:
            found, subindex = described.resolve(parameter)
        except ParameterError:
            raise ConfigError(f"{described.name} has no parameter {parameter!r}") from None
        self._reference = self._reference % 0xFF + 1
        due = now + self.master.settings.request_timeout_ns
        job = ParameterJob(found, subindex, value, due, self._reference)
        self._jobs.append((name, job))
        self._go_on(now)
        return job

    def access_record(self, axis: str, index: int, data: bytes | None, now: int) -> RecordJob:
        """See :class:`pnfarm.buses.controller.RecordController`: in slot 0."""
        name = self.plan.devices[self._place(axis)].name
        request = RecordRequest.read(0, index, MOST_USER_DATA) if data is None else RecordRequest.write(0, index, data)
        if index > HIGHEST_INDEX or len(request.data) > MOST_USER_DATA:
            request.fail(f"DP-V1 has indexes to {HIGHEST_INDEX}, and {MOST_USER_DATA} octets at most")
        job = RecordJob(request)
        self._jobs.append((name, job))
        self._go_on(now)
        return job

    def ask_station(self, question: LineQuestion, now: int) -> StationParameter:
        """See :class:`pnfarm.buses.line_parameters.AskedController`: of the slave with this address."""
        device = next((one for one in self.plan.devices if one.slave.address == question.station), None)
        if device is None:
            known = ", ".join(str(one.slave.address) for one in self.plan.devices)
            raise ConfigError(f"controller {self.name} has no station {question.station}; it has {known}")
        parameter, subindex = addressed(question, device.described)
        due = now + self.master.settings.request_timeout_ns
        work = ParameterQuestion(parameter, subindex, question.value, due)
        self._jobs.append((device.name, work))
        self._go_on(now)
        return StationParameter(device.name, parameter, subindex, work)
