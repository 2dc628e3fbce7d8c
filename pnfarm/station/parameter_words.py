"""The cyclic parameter channel (PKW) of one drive: takes tasks from the engine, writes responses into the image."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.profiles.profidrive.pkw import PKW_OCTETS
from pnfarm.drives.profiles.profidrive.pkw_channel import PkwChannel

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.parameters.store import ParameterStore

__all__ = ["StationParameterWords"]


class StationParameterWords:
    """Answers the tasks that the engine reports; it reports none for a drive without such a channel.

    In the image the eight octets are one signed integer, so that the engine sees a response whole or not at all.

    ``latency`` gives the processing time of a new task, ns, None for no time.  Until it is over the response is
    "no response" (Moog MSD manual, table 8.18, identifier 0; that the drive sends it meanwhile is assumed), and the
    engine reports no other task.
    """

    def __init__(self, store: ParameterStore, latency: Callable[[], int] | None = None) -> None:
        words = store.model.profidrive.parameter_words
        self._channel = None if words is None else PkwChannel(store, words)
        self._latency = latency
        self._image = store.handle.image
        self._working: tuple[int, int] | None = None
        self.reset()

    def reset(self) -> None:
        """The connection ended, or the drive was switched on: no task is pending."""
        self._working = None
        if self._channel is not None:
            self._channel.reset()
            self._image.parameter_answer = 0
            self._image.parameter_repeats = 0
            # the engine waits for no response to earlier tasks
            self._image.parameter_answered = self._image.parameter_task

    def next_deadline(self) -> int | None:
        """When the pending task is to be carried out."""
        return None if self._working is None else self._working[0]

    def handle_timeout(self, now: int) -> None:
        """Carry out the pending task when it is due."""
        if self._working is not None and self._working[0] <= now:
            _, task = self._working
            self._working = None
            self._answer(task)

    def take(self, task: int, now: int) -> None:
        """A task from the set points, new or repeated."""
        if self._channel is None or self._working is not None:
            return
        new = task != int(self._image.parameter_answered)
        latency = self._latency() if new and task and self._latency is not None else 0
        if latency > 0:
            self._image.parameter_answer = 0
            self._image.parameter_repeats = 0
            self._working = (now + latency, task)
        else:
            self._answer(task)

    def _answer(self, task: int) -> None:
        if self._channel is None:
            return
        answer = self._channel.answer(task.to_bytes(PKW_OCTETS, "big", signed=True))
        self._image.parameter_answer = int.from_bytes(answer, "big", signed=True)
        self._image.parameter_repeats = self._channel.repeats
        self._image.parameter_answered = task
