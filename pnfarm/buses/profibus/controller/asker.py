"""One parameter of any slave, as a series of requests; and a master of class 2, alone on a line, that asks for it.

A slave that no model describes is asked by the numbers of PROFIdrive: its own answer says the format of a value, which
is read before it is written.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses.profibus.controller.parameters import ParameterJob
from pnfarm.drives.profiles.profidrive.base_mode import format_octets
from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.records_master import RecordsMaster
from pnfarm.protocols.profibus.wire.telegram import parse_telegram

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pnfarm.buses.profibus.controller.parameters import Addressed
    from pnfarm.links.base import Link, Port
    from pnfarm.protocols.profibus.record_request import RecordRequest
    from pnfarm.protocols.profibus.records_master import RecordsSettings

__all__ = ["ByNumber", "ParameterAsker", "ParameterQuestion"]


@dataclass(frozen=True, slots=True)
class ByNumber:
    """A parameter of which only the number is known; ``elements`` is not 0 where one of an array is asked for."""

    pnu: int
    elements: int = 0
    octets: int = 0


class ParameterQuestion:
    """Read ``parameter``, or write ``wanted`` and read it back; ``answer`` is the last job, once ``done``.

    ``error`` says why it failed; ``refused`` is the number of the drive's error where it was the drive that refused.
    """

    def __init__(self, parameter: Addressed, subindex: int, wanted: int | None, due_ns: int) -> None:
        self.answer: ParameterJob | None = None
        self.error = ""
        self.refused: int | None = None
        self._jobs = self._steps(parameter, subindex, wanted, due_ns)
        self._job = next(self._jobs, None)

    @property
    def done(self) -> bool:
        return self._job is None

    def _steps(self, parameter: Addressed, subindex: int, wanted: int | None, due_ns: int) -> Iterator[ParameterJob]:
        """What is asked for in turn; each job is done, and was no failure, before the next one."""
        read = ParameterJob(parameter, subindex, None, due_ns)
        if wanted is None or not parameter.octets:
            yield read
        if wanted is None:
            return
        octets = parameter.octets or format_octets(read.format) or 0
        if not octets:
            self.error = "it has no value that could be written"
        elif not -(1 << 8 * octets - 1) <= wanted < 1 << 8 * octets:
            self.error = f"{wanted} does not fit in the {octets} octets of the parameter"
        else:
            yield ParameterJob(parameter, subindex, wanted, due_ns, 2, wanted_format=read.format)
            yield ParameterJob(parameter, subindex, None, due_ns, 3)

    def advance(self, ask: Callable[[RecordRequest], None], now: int) -> None:
        """Go on as far as possible; ``ask`` sends a request for a record."""
        while (job := self._job) is not None:
            job.advance(ask, now)
            if not job.done:
                return
            if job.error:
                self.refused, self.error = job.refused, job.error
                self._job = None
                return
            self.answer = job
            self._job = next(self._jobs, None)


class ParameterAsker:
    """A question at work: a node with a master of its own.  ``question`` is set by :meth:`begin`."""

    def __init__(self, link: Link, port: Port, settings: RecordsSettings) -> None:
        self.link, self.port = link, port
        self.master = RecordsMaster(settings)
        self.question: ParameterQuestion | None = None
        self.done = False
        #: Telegrams that cannot be read.
        self.broken = 0
        link.set_receiver(self.receive)

    def begin(self, parameter: Addressed, subindex: int, wanted: int | None, now: int) -> None:
        """Listen, and ask then."""
        settings = self.master.settings
        due = now + settings.listen_ns + settings.request_timeout_ns
        self.question = ParameterQuestion(parameter, subindex, wanted, due)
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
        """Go on as far as possible."""
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
        def ask(record: RecordRequest) -> None:
            self.master.ask(record, now)

        question.advance(ask, now)
        if question.done:
            self.master.end()

    def next_deadline(self) -> int | None:
        """When :meth:`service` is due."""
        return None if self.done else self.master.next_deadline()
