"""Festo's edcon (PyPI: festo-edcon) as master of a virtual drive: its frames, its polls and its pauses in virtual time.

edcon knows PROFIdrive's state machine and telegrams by itself.  The built-in controller carries its octets and nothing
else: every word of a telegram is a register without a meaning, so that both ends must agree on the layout.
"""

from __future__ import annotations

from dataclasses import field, make_dataclass, replace

from edcon.edrive.com_base import ComBase
from edcon.edrive.motion_handler import MotionHandler
from edcon.edrive.position_telegram_handler import PositionTelegramHandler
from edcon.edrive.telegram1_handler import Telegram1Handler
from edcon.edrive.telegram9_handler import Telegram9Handler
from edcon.edrive.telegram102_handler import Telegram102Handler
from edcon.edrive.velocity_telegram_handler import VelocityTelegramHandler
from edcon.profidrive import words
from edcon.profidrive.telegram1 import Telegram1
from edcon.profidrive.telegram9 import Telegram9
from edcon.profidrive.telegram102 import Telegram102
from edcon.profidrive.telegram111 import Telegram111
from parameter_requests import change_request, read_request, results
from virtual_line import VirtualLine

from pnfarm.drives.catalogue import model
from pnfarm.drives.profiles.profidrive.base_mode import (
    ParameterAddress,
    ParameterValues,
    emit_request,
    parse_response,
)
from pnfarm.drives.profiles.profidrive.description import format_of
from pnfarm.table.signals import word_code

#: edcon's telegrams and handlers by telegram number; its MotionHandler is that of telegram 111 with overrides of 100 %.
TELEGRAMS = {1: Telegram1, 9: Telegram9, 102: Telegram102, 111: Telegram111}
HANDLERS = {1: Telegram1Handler, 9: Telegram9Handler, 102: Telegram102Handler, 111: MotionHandler}

#: Signals that a manual calls otherwise than the profile, and where: Moog MSD, 8.2.1, table 8.8.
OTHER_NAMES = {"TARPOS_A": "MDI_TARPOS", "VELOCITY_A": "MDI_VELOCITY"}


class StillWaitingError(Exception):
    """edcon waits longer than the test lets it; many of its waits have no end of their own."""


class VirtualTime:
    """Takes the place of the module ``time`` in edcon: a pause lets the world run."""

    def __init__(self, line: VirtualLine) -> None:
        self._line = line

    def time(self) -> float:
        return self._line.world.now / 1e9

    def sleep(self, seconds: float) -> None:
        self._line.run(seconds)


class LineCom(ComBase):
    """What edcon calls a communication driver: one exchange takes one cycle of the line, as its own drivers' do.

    edcon has each value least significant octet first, PROFINET most significant first; the widths are edcon's.
    """

    def __init__(self, line: VirtualLine, telegram, cycle_seconds: float) -> None:
        self.line = line
        self.cycle_seconds = cycle_seconds
        self._outputs = [word.byte_size for word in telegram.outputs()]
        self._inputs = [word.byte_size for word in telegram.inputs()]
        self._image = line.plc.columns.image[0]
        self._active = True
        self._reference = 0
        self.allow(120.0)

    def allow(self, seconds: float) -> None:
        """How long edcon may wait from here on, virtual seconds."""
        self._end = self.line.world.now + round(seconds * 1e9)

    def io_active(self) -> bool:
        return self._active

    def shutdown(self) -> None:
        self._active = False

    def send_io(self, data: bytes, nonblocking: bool = False) -> None:
        if not self._active:
            return
        place = register = 0
        for width in self._outputs:
            octets = data[place : place + width][::-1]
            for half in range(0, width, 2):
                self._image.sent[register] = int.from_bytes(octets[half : half + 2], "big")
                register += 1
            place += width
        self.line.run(self.cycle_seconds)

    def recv_io(self, nonblocking: bool = False) -> bytes:
        if self.line.world.now > self._end:
            raise StillWaitingError
        self.line.run(self.cycle_seconds)
        data, register = b"", 0
        for width in self._inputs:
            octets = b""
            for _ in range(width // 2):
                octets += (int(self._image.received[register]) & 0xFFFF).to_bytes(2, "big")
                register += 1
            data += octets[::-1]
        return data

    # parameters, by the drive's parameter channel

    def read_pnu_raw(self, pnu: int, subindex: int = 0, num_elements: int = 1) -> bytes | None:
        request = read_request(self._next(), [self._address(pnu, subindex)])
        (result,) = results(request, parse_response(self._ask(request)))
        if not isinstance(result, ParameterValues):
            return None
        return result.values[0].to_bytes(self._parameter(pnu).octets, "little")

    def write_pnu_raw(self, pnu: int, subindex: int = 0, num_elements: int = 1, value: bytes = b"\x00") -> bool:
        parameter, access = self._parameter(pnu), self._model.access
        values = ParameterValues(format_of(parameter, typed=access.typed_formats), (int.from_bytes(value, "little"),))
        request = change_request(self._next(), [(self._address(pnu, subindex), values)])
        (result,) = results(request, parse_response(self._ask(request)))
        return isinstance(result, ParameterValues)

    @property
    def _model(self):
        return model(self.line.plc.sessions[0].plan.model)

    def _parameter(self, pnu: int):
        return self._model.parameters[pnu]

    def _address(self, pnu: int, subindex: int) -> ParameterAddress:
        return ParameterAddress(pnu, subindex, 0 if self._model.access.zero_elements else 1)

    def _next(self) -> int:
        self._reference = self._reference % 255 + 1
        return self._reference

    def _ask(self, request) -> bytes:
        line, name = self.line, self.line.plc.sessions[0].plan.name
        place = (0x3A00, 1, 1, 0xB02E)
        line.plc.write_record(name, place, emit_request(request), line.world.now)
        job = line.plc.read_record(name, place, line.world.now, length=240)
        assert line.world.run(5.0, until=lambda: job.done)
        assert job.ok, job.failure
        return job.data


def own_words(number: int, direction: str) -> list[str]:
    """The words of edcon's telegram of this number by the names of their signals, a double word twice."""
    found = []
    for word in getattr(TELEGRAMS[number](), direction)():
        found += [type(word).__name__.removesuffix("_SM").removesuffix("_PM")] * (word.byte_size // 2)
    return found


def names_of(signals) -> list[str | None]:
    return [signal and signal.name for signal in signals]


def knows(telegram) -> bool:
    """Whether edcon has this telegram, word by word; words without a signal at its end do not count."""
    if telegram.number not in TELEGRAMS:
        return False
    for direction, signals in (("outputs", telegram.output), ("inputs", telegram.input)):
        own = own_words(telegram.number, direction)
        if names_of(signals)[: len(own)] != own or any(signals[len(own) :]):
            return False
    return True


def assembled(telegram, base):
    """A telegram that edcon does not have, of edcon's own words and with the fields of one that it has."""

    def attributes(signals) -> list[str]:
        names = [OTHER_NAMES.get(signal.name, signal.name).lower() for signal in signals if signal]
        return list(dict.fromkeys(names))

    outputs, inputs = attributes(telegram.output), attributes(telegram.input)
    known = base.__dataclass_fields__
    more = [
        (name, getattr(words, name.upper()), field(default_factory=getattr(words, name.upper())))
        for name in [*outputs, *inputs]
        if name not in known
    ]
    own = {
        "outputs": lambda self: [getattr(self, name) for name in outputs],
        "inputs": lambda self: [getattr(self, name) for name in inputs],
    }
    return make_dataclass(f"Assembled{telegram.number}", more, bases=(base,), namespace=own, repr=False)()


class EdconLine(VirtualLine):
    """A drive that edcon can drive: ``handler`` is edcon's, ``com`` what it talks through."""

    def __init__(self, name: str, number: int, cycle_ms: int, params: str = "{}") -> None:
        super().__init__(model=name, telegram=number, cycle=f"{cycle_ms}ms", params=params, program="{kind: idle}")
        session = self.plc.sessions[0]
        telegram = model(name).profidrive.telegrams[number]
        registers = [tuple(map(word_code, range(len(w)))) for w in (telegram.output_words, telegram.input_words)]
        session.plan = replace(session.plan, output_words=registers[0], input_words=registers[1])
        # only edcon writes set points
        self.plc.columns.program[0].active = 0
        self.connect()
        self.run(0.2)
        if knows(telegram):
            message = TELEGRAMS[number]()
        else:
            message = assembled(telegram, Telegram9 if telegram.tasks else Telegram102)
        self.com = LineCom(self, message, cycle_ms / 1e3)
        self.handler = self._handler(number, message)

    def _handler(self, number: int, message):
        if type(message) is TELEGRAMS.get(number):
            handler = HANDLERS[number](self.com)
        elif isinstance(message, Telegram9):
            handler = Telegram9Handler.__new__(Telegram9Handler)
            PositionTelegramHandler.__init__(handler, message, self.com)
        else:
            handler = Telegram102Handler.__new__(Telegram102Handler)
            VelocityTelegramHandler.__init__(handler, message, self.com)
        if isinstance(message, Telegram9):
            # edcon 1.0.3 clears a bit of POS_STW1 and shows NIST_B in every telegram of positions; its telegram 9 has
            # neither word
            handler.telegram.pos_stw1, handler.telegram.nist_b = words.POS_STW1(), words.NIST_B()
        return handler

    @property
    def axis(self):
        return self.farm.columns.axis[0]

    @property
    def turns(self) -> float:
        """Position of the axis, revolutions from the home position."""
        return float(self.axis.motor.position) - float(self.axis.homing.origin)
