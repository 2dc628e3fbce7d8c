"""One parameter of any slave of a line, asked for by a master of class 2 that is alone there; without clock and tasks.

A slave that no model describes is asked by the numbers of PROFIdrive: its own answer says the format of a value, which
is read before it is written.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from pnfarm.buses.profibus.controller.parameters import ParameterJob
from pnfarm.drives.profiles.profidrive.base_mode import format_octets
from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.records_master import RecordsMaster
from pnfarm.protocols.profibus.wire.telegram import parse_telegram

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.profibus.controller.parameters import Addressed
    from pnfarm.links.base import Link, Port
    from pnfarm.protocols.profibus.record_request import RecordRequest
    from pnfarm.protocols.profibus.records_master import RecordsSettings

__all__ = ["ByNumber", "ParameterAsker"]

#: References of the first and of all further requests.
_LAST_REFERENCE: Final = 0xFF


@dataclass(frozen=True, slots=True)
class ByNumber:
    """A parameter of which only the number is known; ``elements`` is not 0 where one of an array is asked for."""

    pnu: int
    elements: int = 0
    octets: int = 0


class ParameterAsker:
    """Read ``parameter``, or write ``wanted`` and read it back; ``answer`` is the last job, once ``done``.

    ``error`` says why it failed; ``refused`` is the number of the drive's error where it was the drive that refused.
    """

    def __init__(self, link: Link, port: Port, settings: RecordsSettings) -> None:
        self.link, self.port = link, port
        self.master = RecordsMaster(settings)
        self.answer: ParameterJob | None = None
        self.error = ""
        self.refused: int | None = None
        self.done = False
        #: Telegrams that cannot be read.
        self.broken = 0
        self._job: ParameterJob | None = None
        self._jobs: Iterator[ParameterJob] = iter(())
        link.set_receiver(self.receive)

    def begin(self, parameter: Addressed, subindex: int, wanted: int | None, now: int) -> None:
        """Listen, and ask then."""
        self._jobs = self._steps(parameter, subindex, wanted, now)
        self._job = next(self._jobs, None)
        self.master.start(now)
        self.service(now)

    def _steps(self, parameter: Addressed, subindex: int, wanted: int | None, now: int) -> Iterator[ParameterJob]:
        """What is asked for in turn; each job is done, and was no failure, before the next one."""
        due = now + self.master.settings.listen_ns + self.master.settings.request_timeout_ns
        read = ParameterJob(parameter, subindex, None, due)
        if wanted is None or not parameter.octets:
            yield read
        if wanted is None:
            return
        octets = parameter.octets or format_octets(read.format) or 0
        if not -(1 << 8 * octets - 1) <= wanted < 1 << 8 * octets:
            self._end(f"{wanted} does not fit in the {octets} octets of the parameter" if octets else "it has no value")
            return
        yield ParameterJob(parameter, subindex, wanted, due, 2, wanted_format=read.format)
        yield ParameterJob(parameter, subindex, None, due, 3)

    # -- a node ------------------------------------------------------------------------------------------------------

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
        self._go_on(now)
        master = self.master
        master.handle_timeout(now)
        while (octets := master.to_send()) is not None:
            self.link.send(self.port.index, octets)
            master.sent(now)
        self._go_on(now)
        if self._job is None and master.over:
            self.done = True

    def next_deadline(self) -> int | None:
        """When :meth:`service` is due."""
        return None if self.done else self.master.next_deadline()

    def _go_on(self, now: int) -> None:
        def ask(record: RecordRequest) -> None:
            self.master.ask(record, now)

        while (job := self._job) is not None:
            job.advance(ask, now)
            if not job.done:
                return
            if job.error:
                self.refused = job.refused
                self._end(job.error)
            else:
                self.answer = job
                self._job = next(self._jobs, None)
                if self._job is None:
                    self.master.end()

    def _end(self, error: str) -> None:
        self.error = error
        self._job, self._jobs = None, iter(())
        self.master.end()
