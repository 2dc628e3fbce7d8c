"""One parameter of any slave, as a series of requests.

A slave that no model describes is asked by the numbers of PROFIdrive: its own answer says the format of a value, which
is read before it is written.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pnfarm.buses.profibus.controller.parameters import ParameterJob
from pnfarm.drives.profiles.profidrive.base_mode import format_octets

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pnfarm.buses.profibus.controller.parameters import Addressed
    from pnfarm.protocols.profibus.record_request import RecordRequest

__all__ = ["ByNumber", "ParameterQuestion"]


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
