"""The cyclic parameter channel (PKW) of one drive: from the engine's word of a task to the answer in its image."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.drives.profiles.profidrive.pkw import PKW_OCTETS
from pnfarm.drives.profiles.profidrive.pkw_channel import PkwChannel

if TYPE_CHECKING:
    from pnfarm.drives.store import ParameterStore

__all__ = ["StationParameterWords"]


class StationParameterWords:
    """Answers the tasks that the engine tells of; a drive without such a channel is never told of one.

    In the image the eight octets are one number with a sign, so that the engine sees all of an answer or nothing.
    """

    def __init__(self, store: ParameterStore) -> None:
        words = store.model.parameter_words
        self._channel = None if words is None else PkwChannel(store, words)
        self._image = store.handle.image
        self.reset()

    def reset(self) -> None:
        """The connection is gone, or the drive was switched on: nothing is answered yet."""
        if self._channel is not None:
            self._channel.reset()
            self._image.parameter_answer = 0
            self._image.parameter_repeats = 0

    def take(self, task: int) -> None:
        """A task as it stands in the set points, new or once more."""
        if self._channel is not None:
            answer = self._channel.answer(task.to_bytes(PKW_OCTETS, "big", signed=True))
            self._image.parameter_answer = int.from_bytes(answer, "big", signed=True)
            self._image.parameter_repeats = self._channel.repeats
            self._image.parameter_answered = task
