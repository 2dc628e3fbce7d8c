"""``pnfarm param --line`` on PROFIBUS: a question in the user's words, and its answer in them."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from pnfarm.buses.profibus.controller.asker import ByNumber, ParameterQuestion
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.numbering import read_number
from pnfarm.drives.parameters.parameter import Form, Parameter, ParameterError, ParameterErrorNumber
from pnfarm.drives.profiles.profidrive.base_mode import format_octets
from pnfarm.errors import ConfigError, DecodeError, RemoteError
from pnfarm.protocols.profibus.records_master import RecordsMaster, RecordsSettings
from pnfarm.protocols.profibus.wire.telegram import parse_telegram

if TYPE_CHECKING:
    from pnfarm.buses.line_parameters import LineQuestion
    from pnfarm.buses.profibus.controller.parameters import Addressed
    from pnfarm.drives.description.model import Model
    from pnfarm.links.base import Link, Port

__all__ = ["LineParameter", "StationParameter", "addressed", "answer_of", "shown_value"]

HIGHEST_STATION: Final = 126
HIGHEST_PNU: Final = 0xFFFF
#: Formats of whole numbers with a sign, and that of numbers of single precision (PROFIdrive 4.1, 5.4).
_SIGNED, _FLOAT = frozenset({0x02, 0x03, 0x04, 0x71, 0x72}), 0x08


class LineParameter:
    """See :class:`pnfarm.buses.line_parameters.LineAsker`: a master of class 2, alone on a line.

    ``question`` is there from the start on; ``broken`` counts telegrams that cannot be read.
    """

    def __init__(self, link: Link, port: Port, question: LineQuestion) -> None:
        for what, address in (("a station address", question.station), ("an own address", question.own)):
            if not 0 <= address <= HIGHEST_STATION:
                raise ConfigError(f"{address} is not {what}, which is 0 to {HIGHEST_STATION}")
        if question.own == question.station:
            raise ConfigError(f"the master cannot have the station's own address, {question.own}")
        self.link, self.port = link, port
        self.master = RecordsMaster(RecordsSettings(question.station, question.own, question.baud))
        self.question: ParameterQuestion | None = None
        self.done = False
        self.broken = 0
        self._asked = question
        self._parameter, self._subindex = addressed(question)
        link.set_receiver(self.receive)

    def start(self, now: int) -> None:
        """Listen, and ask then."""
        settings = self.master.settings
        due = now + settings.listen_ns + settings.request_timeout_ns
        self.question = ParameterQuestion(self._parameter, self._subindex, self._asked.value, due)
        self.master.start(now)
        self.service(now)

    def receive(self, port: int, frame: bytes, now: int) -> None:
        """One telegram of the line."""
        del port
        try:
            telegram = parse_telegram(frame)
        except DecodeError:
            self.broken += 1
            return
        self.master.receive(telegram, now)
        self.service(now)

    def service(self, now: int) -> None:
        question, master = self.question, self.master
        if question is None:
            return
        self._ask(question, now)
        master.handle_timeout(now)
        while (octets := master.to_send()) is not None:
            self.link.send(self.port.index, octets)
            master.sent(now)
        self._ask(question, now)
        self.done = question.done and master.over

    def _ask(self, question: ParameterQuestion, now: int) -> None:
        question.advance(lambda record: self.master.ask(record, now), now)
        if question.done:
            self.master.end()

    def next_deadline(self) -> int | None:
        return None if self.done else self.master.next_deadline()

    def result(self) -> dict[str, Any]:
        return answer_of(f"station {self._asked.station}", self._parameter, self._subindex, self.question)


@dataclass(slots=True)
class StationParameter:
    """See :class:`pnfarm.buses.line_parameters.Asked`: a question to a slave of a master that is at work."""

    name: str
    parameter: Addressed
    subindex: int
    question: ParameterQuestion

    @property
    def done(self) -> bool:
        return self.question.done

    def result(self) -> dict[str, Any]:
        return answer_of(self.name, self.parameter, self.subindex, self.question)


def answer_of(name: str, parameter: Addressed, subindex: int, question: ParameterQuestion | None) -> dict[str, Any]:
    """The answer as the API has a parameter, or what :meth:`pnfarm.buses.line_parameters.Asked.result` raises."""
    what = f"{name}, parameter {parameter.pnu}.{subindex}"
    if question is None or not question.done:
        raise RemoteError(f"{what}: no answer")
    if question.refused is not None:
        raise ParameterError(question.refused, detail=what)
    if question.error or question.answer is None:
        raise RemoteError(f"{what}: {question.error or 'no answer'}")
    known = parameter if isinstance(parameter, Parameter) else None
    return {
        "drive": name,
        "pnu": parameter.pnu,
        "subindex": subindex,
        "name": known.name if known is not None else "",
        "value": shown_value(question.answer.value, question.answer.format, known),
        "values": None,
        "unit": known.unit if known is not None else "",
    }


def shown_value(value: int | None, code: int, known: Parameter | None) -> int | float | None:
    """A value off the wire by its format, or by the model's type, as the API shows it."""
    if value is None:
        return None
    if known is None and code == _FLOAT:
        (single,) = struct.unpack(">f", value.to_bytes(4, "big"))
        return float(single)
    bits = 8 * (format_octets(code) or 4)
    signed = code in _SIGNED if known is None else known.signed and known.form is Form.INTEGER
    return value - (1 << bits) if signed and value >> bits - 1 else value


def addressed(question: LineQuestion, described: Model | None = None) -> tuple[Addressed, int]:
    """The parameter by the model that the question names, else by ``described``, else by its number.

    Raises :class:`ParameterError` or :class:`ConfigError`.
    """
    if question.model is not None:
        described = model(question.model)
    if described is not None:
        if described.bus != "profibus":
            raise ConfigError(f"{described.name} is no model of this bus")
        return described.resolve(question.parameter)
    number, dot, index = question.parameter.partition(".")
    pnu, subindex = read_number(number), read_number(index) if dot else 0
    if pnu is None or subindex is None:
        raise ConfigError(f"{question.parameter!r} is not the number of a parameter; a name needs the drive's --model")
    if not 1 <= pnu <= HIGHEST_PNU or not 0 <= subindex <= HIGHEST_PNU:
        raise ParameterError(ParameterErrorNumber.IMPERMISSIBLE_PNU, detail=f"{question.parameter}")
    return ByNumber(pnu, 1 if dot else 0), subindex
