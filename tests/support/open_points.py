"""What each reading of a model's open points shows to a PLC: one observation for each point, and what it is to be.

An observation runs a drive of a model over the wire, in virtual time, with a ``behaviour`` of its farm file, and gives
back what its controller sees; :data:`OBSERVATIONS` holds it by the name of the point, with what each reading shows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from hand_plc import HandPlc
from parameter_requests import change_request, read_request
from record_line import access

from pnfarm.drives.profiles.profidrive.base_mode import (
    ParameterAddress,
    ParameterResponse,
    ParameterValues,
    emit_request,
    parse_response,
)
from pnfarm.protocols.profibus.record_request import RecordRequest
from pnfarm.protocols.profibus.wire.dpv1 import ErrorCode1

#: Telegrams of speed and of positions, and control words with operation enabled, of each model.
SPEED = {"akd-profinet": 1, "akd-profinet-2012": 1, "hiwin-e1": 3, "moog-msd": 1, "profidrive": 1}
TASKS = {"akd-profinet": 9, "akd-profinet-2012": 9, "hiwin-e1": 9, "moog-msd": 9, "profidrive": 9}
#: Of the E1: increments to a revolution.
COUNTS_E1 = 1 << 23
#: Record index of base mode parameter access.
PARAMETERS = 0xB02E
RUN = 0x047F
#: Of positions: STW1.4 and 5, and no task yet.
READY, START, ACKNOWLEDGE, JOG_1, JOG_2, HOME = 0x043F, 0x0040, 0x0080, 0x0100, 0x0200, 0x0800
FAULT, IN_RANGE, REACHED, HOMED, TAKEN, STOPPED = 0x0008, 0x0100, 0x0400, 0x0800, 0x1000, 0x2000


def kind(name: str) -> str:
    """The model's name on a network: a drive on a line has the points of its sibling there."""
    return name.removesuffix("-dp")


class Plc(HandPlc):
    """A PLC at 1 ms with one drive of a model; ``behaviour`` is the farm file's."""

    def __init__(self, name: str, behaviour: str, telegram: int, **options) -> None:
        self.drive = kind(name)
        super().__init__(name, telegram, **{"behaviour": behaviour, "limits": "lax"} | options)

    def change(self, pnu: int, form: int, value: int) -> int | None:
        """A parameter by a request over the wire: None, or the number of the error."""
        response = self._ask(
            emit_request(change_request(7, [(ParameterAddress(pnu, 0, 1), ParameterValues(form, (value,)))]))
        )
        return response.entries[0].values[0] if response.negative else None

    def read(self, pnu: int) -> int:
        return self.ask(pnu).entries[0].values[0]

    def ask(self, pnu: int, count: int = 1) -> ParameterResponse:
        """What a read of ``count`` elements is answered with."""
        return self._ask(emit_request(read_request(7, [ParameterAddress(pnu, 0, count)])))

    def buffer(self) -> tuple[int, ...]:
        """The first 16 places of the fault buffer (PNU 947)."""
        return self._ask(emit_request(read_request(7, [ParameterAddress(947, 0, 16)]))).entries[0].values

    def map_words(self, *, setpoints: list[int], actual_values: list[int]) -> None:
        """Words of a telegram that is mapped freely, in the drive (P-0915, P-0916) and in the controller's eyes."""
        self.store.write(915, 0, setpoints)
        self.store.write(916, 0, actual_values)
        self.plc.image_of(0).layout(self.store.input_words(), self.store.output_words())
        self.wait(10)

    def power_cycle(self) -> None:
        """Off and on; then connected again, STW1 without anything but its bit 10."""
        self.put(STW1=0x0400)
        self.farm.axes[0].station.power_cycle(self.world.now)
        self.run(1.0)
        self.connect()
        self.wait(200)

    def _ask_on_line(self, request: bytes) -> bytes:
        """MSAC1; reading is tried again until the answer is there."""
        master, axis = self.plc.master, self.plc.plan.devices[0].name

        def carried_out(record: RecordRequest) -> RecordRequest:
            master.ask(axis, record, self.world.now)
            assert self.world.run(1.0, until=lambda: record.done)
            return record

        assert carried_out(RecordRequest.write(0, 47, request)).ok
        for _ in range(100):
            read = carried_out(RecordRequest.read(0, 47, 240))
            if read.ok:
                return read.data
            assert read.refused is not None
            assert read.refused[0] == ErrorCode1.STATE_CONFLICT
        raise AssertionError("no answer")

    def _ask(self, request: bytes) -> ParameterResponse:
        if self.is_on_line:
            return parse_response(self._ask_on_line(request))
        return parse_response(access(self, request, index=PARAMETERS))

    def rpm(self) -> float:
        return float(self.axis.motor.velocity)


def task_plc(name: str, behaviour: str, *, homed: bool = True, **options) -> Plc:
    """In operation, position control by tasks of the telegram; the AKD must be homed, which it is at once."""
    params = {
        "akd-profinet": "{DRV.OPMODE: 2}",
        "akd-profinet-2012": "{930: 2}",
        # the rising edge of STW1.6 alone starts a task, as with the others
        "moog-msd": "{P-1267: 64}",
    }.get(kind(name), "{}")
    plc = Plc(name, behaviour, TASKS[kind(name)], **{"params": params} | options)
    plc.switch_on(operation=READY)
    if homed and plc.drive.startswith("akd"):
        home(plc)
    return plc


def home(plc: Plc) -> None:
    """Homing by STW1.11: the AKD at its position, the others at the next zero mark."""
    plc.put(STW1=READY | HOME)
    plc.wait_for(lambda: plc["ZSW1"] & HOMED != 0)
    plc.put(STW1=READY, wait=50)


def start(plc: Plc, revolutions: float, rpm: float = 600.0, *, relative: bool = False) -> bool:
    """A task of the telegram by the edge of STW1.6; whether ZSW1.12 acknowledged it.  The bit falls again."""
    stw1 = READY
    if plc.drive == "moog-msd":
        stw1 |= 0x1000 if relative else 0
        plc.put(wait=1, TARPOS_A=round(revolutions * 65536), VELOCITY_A=round(rpm))
    else:
        counts = COUNTS_E1 if plc.drive == "hiwin-e1" else 65536
        velocity = rpm * COUNTS_E1 / 1000 if plc.drive == "hiwin-e1" else rpm / 12000 * 2**32
        ramp = 0x4000 if plc.drive == "hiwin-e1" else 39
        plc.put(
            wait=1,
            SATZANW=0x8000,
            MDI_TARPOS=round(revolutions * counts),
            MDI_VELOCITY=round(velocity),
            MDI_ACC=ramp,
            MDI_DEC=ramp,
            MDI_MOD=0 if relative else 1,
        )
    taken = bool(plc.put(STW1=stw1 | START) & TAKEN)
    plc.put(STW1=stw1)
    return taken


def speed_plc(name: str, behaviour: str, **options) -> Plc:
    """In operation, speed control."""
    plc = Plc(name, behaviour, SPEED[kind(name)], **options)
    plc.switch_on(operation=RUN)
    return plc


@dataclass(frozen=True)
class Observation:
    """``look`` at a drive of a model with this ``behaviour``; ``shows`` has what is seen for each reading."""

    look: Callable[[str, str], object]
    shows: Mapping[str, object]


OBSERVATIONS: dict[str, Observation] = {}


def observes(point: str, shows: Mapping[str, object]) -> Callable[[Callable[[str, str], object]], Callable]:
    """Registers an observation of a point, of all models that have it."""

    def register(look: Callable[[str, str], object]) -> Callable[[str, str], object]:
        assert point not in OBSERVATIONS
        OBSERVATIONS[point] = Observation(look, shows)
        return look

    return register
