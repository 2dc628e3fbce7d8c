"""The toy bus with a controller, which has no IP address: one order to each drive in each pace, by the event loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NoReturn

from pydantic import Field

from pnfarm.config.controller import ControllerSection
from pnfarm.config.values import Duration
from pnfarm.drives.telegrams.signal_view import AxisSignals, SignalForm
from pnfarm.drives.telegrams.word_bits import STW1_BITS, ZSW1_BITS
from pnfarm.engine.columns import allocate
from pnfarm.errors import ConfigError, DecodeError
from pnfarm.table.signals import NIST_A, NSOLL_A, STW1, ZSW1
from pnfarm.wire.ethernet import parse_ethernet
from toybus.bus import ToyBus
from toybus.device.device import REFERENCE, REST, RUN, SILENCE_NS
from toybus.farm_file import ToyPart
from toybus.frames import ETHERTYPE, Order, Report, emit_order, frame, parse_report

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.buses.controller import ControllerHost

_STEP = REFERENCE / 0x4000
SIGNALS = AxisSignals(
    {
        "stw1": SignalForm("stw1", STW1, 16, False, 0.0, "", STW1_BITS),
        "nsoll_a": SignalForm("nsoll_a", NSOLL_A, 16, True, _STEP, "rpm", ()),
    },
    {
        "zsw1": SignalForm("zsw1", ZSW1, 16, False, 0.0, "", ZSW1_BITS),
        "nist_a": SignalForm("nist_a", NIST_A, 16, True, _STEP, "rpm", ()),
    },
)


class ToyController(ControllerSection):
    """The toy bus's master."""

    pace_ns: Duration = Field(default=10_000_000, alias="pace", description="Pause between two orders.")


@dataclass(frozen=True, slots=True)
class ToyPlanned:
    name: str
    model: str
    mac: bytes
    cycle_ns: int
    signals: AxisSignals = SIGNALS
    life: bool = False

    @property
    def axes(self) -> list[tuple[str, ToyPlanned]]:
        return [(self.name, self)]


@dataclass(frozen=True, slots=True)
class ToyPlan:
    devices: Sequence[ToyPlanned]
    section: ToyController
    udp_ports: tuple[None, tuple[int, ...]] = (None, ())


@dataclass(slots=True)
class _Talk:
    """What the master knows of one drive."""

    report: Report | None = None
    heard_ns: int = 0
    connects: int = 0
    losses: int = 0
    sent: int = 0
    received: int = 0
    tasks: list[Any] = field(default_factory=list)


class ToyCore:
    """See :class:`pnfarm.buses.controller.Controller`."""

    def __init__(self, plan: ToyPlan, host: ControllerHost) -> None:
        self.plan, self.link, self.port = plan, host.link, host.port
        count = len(plan.devices)
        self.columns = allocate(images=count, programs=count)
        self.talks = {one.name: _Talk() for one in plan.devices}
        self._by_mac = {one.mac: (row, one) for row, one in enumerate(plan.devices)}
        self._due: int | None = None
        self.link.set_receiver(self.receive)

    def start(self, now: int) -> None:
        self._due = now

    def release(self, now: int) -> None:
        self._due = None
        for talk in self.talks.values():
            talk.report = None

    def receive(self, port: int, data: bytes, now: int) -> None:
        if data[12:14] != ETHERTYPE.to_bytes(2, "big") or data[6:12] not in self._by_mac or self._due is None:
            return
        row, one = self._by_mac[data[6:12]]
        talk, image = self.talks[one.name], self.columns.image[row]
        try:
            report = parse_report(parse_ethernet(data).payload)
        except DecodeError:
            return
        talk.connects += talk.report is None
        talk.report, talk.heard_ns = report, now
        talk.received += 1
        image.received[ZSW1], image.received[NIST_A] = report.status, round(report.speed / _STEP)
        image.frames += 1
        image.valid = 1

    def service(self, now: int) -> None:
        if self._due is None or now < self._due:
            return
        self._due = now + self.plan.section.pace_ns
        for row, one in enumerate(self.plan.devices):
            talk = self.talks[one.name]
            if talk.report is not None and now - talk.heard_ns >= SILENCE_NS:
                talk.report, self.columns.image[row].valid = None, 0
                talk.losses += 1
            self._command(row, talk)
            words = self.columns.image[row].sent
            speed = round((int(words[NSOLL_A]) + 0x8000) % 0x10000 * _STEP - 0x8000 * _STEP)
            order = Order(bool(words[STW1] & 1), speed)
            self.link.send(self.port.index, frame(one.mac, self.port.mac, emit_order(order)))
            talk.sent += 1

    def _command(self, row: int, talk: _Talk) -> None:
        """The built-in program: at rest until the drive is ready, then at speed."""
        program = self.plan.section.program
        if program.python is None:
            runs = talk.report is not None and bool(talk.report.status & 1) and program.kind != "idle"
            self.columns.image[row].sent[STW1] = RUN if runs else REST
            self.columns.image[row].sent[NSOLL_A] = round(program.speed_rpm / _STEP) if runs else 0

    def next_deadline(self) -> int | None:
        return self._due

    @property
    def all_connected(self) -> bool:
        return all(talk.report is not None for talk in self.talks.values())

    @property
    def all_running(self) -> bool:
        return all(talk.report is not None and talk.report.status & 4 for talk in self.talks.values())

    @property
    def all_stopped(self) -> bool:
        return self._due is None

    def exchanging(self, name: str) -> bool:
        return name in self.talks and self.talks[name].report is not None

    def snapshot(self) -> list[dict[str, Any]]:
        return [self._row(one, self.talks[one.name]) for one in self.plan.devices]

    def _row(self, one: ToyPlanned, talk: _Talk) -> dict[str, Any]:
        status = talk.report.status if talk.report is not None else 0
        return {
            "name": one.name, "model": one.model, "ip": "", "state": "DATA" if talk.report else "SEARCH",
            "phase": "running" if status & 4 else "off", "zsw1": status, "stw1": 0, "connects": talk.connects,
            "losses": talk.losses, "faults": 0, "cycle_seconds": one.cycle_ns / 1e9, "frames_sent": talk.sent,
            "frames_received": talk.received, "unusable": [], "last_reason": "",
        }  # fmt: skip

    def put_parameter_task(self, name: str, task: object) -> NoReturn:
        raise ConfigError(f"the orders of drive {name!r} have no parameter channel")

    def parameter_answer(self, name: str) -> NoReturn:
        self.put_parameter_task(name, None)


class ControlledPart(ToyPart):
    controller = ToyController

    def check_controller(self, controller, groups, known, report):
        if controller.pace_ns >= SILENCE_NS:
            report(("controller", "pace"), "is longer than the drives wait", "less than 100ms")


class ControlledToyBus(ToyBus):
    farm_file = ControlledPart()

    def plan(self, section, drives, models, folder):
        return ToyPlan([ToyPlanned(one.name, one.model, one.mac, section.pace_ns) for one in drives], section)

    def controller(self, plan, host):
        return ToyCore(plan, host)


CONTROLLED_TOYBUS = ControlledToyBus()
