"""Answers to explicit messages leave when the drive has worked on them: one after the other, each with its latency.

A drive's application objects take time (AKD EtherNet/IP manual, chapter 3: from about 5 ms to 5 s); those of the
standard answer at once, but not before an answer that waits on the same stream.
"""

from __future__ import annotations

from collections import Counter, deque
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable, Container

    from pnfarm.protocols.enip.encapsulation import SendStream
    from pnfarm.protocols.enip.object import Answer, CipObject

__all__ = ["HeldAnswers", "WorkingObject", "WorkingTime"]

#: Answers that wait on one stream; a peer that asks on and on beyond that loses it.
MOST_HELD: Final = 256


class WorkingTime:
    """Adds up the latency of what the application objects did; ``latency`` gives one request's, ns, None for none."""

    def __init__(self, latency: Callable[[], int] | None) -> None:
        self._latency = latency
        self._spent = 0

    def work(self) -> None:
        """One request to an application object."""
        self._spent += self._latency() if self._latency is not None else 0

    def take(self) -> int:
        """The time of what was done since the last call, ns."""
        spent, self._spent = self._spent, 0
        return spent


class WorkingObject:
    """An application object that takes its time."""

    def __init__(self, inner: CipObject, time: WorkingTime) -> None:
        self._inner = inner
        self._time = time

    @property
    def class_id(self) -> int:
        return self._inner.class_id

    @property
    def instances(self) -> Container[int]:
        return self._inner.instances

    def get(self, instance: int, attribute: int) -> Answer:
        self._time.work()
        return self._inner.get(instance, attribute)

    def set(self, instance: int, attribute: int, data: bytes) -> Answer:
        self._time.work()
        return self._inner.set(instance, attribute, data)

    def service(self, instance: int, service: int, data: bytes) -> Answer:
        self._time.work()
        return self._inner.service(instance, service, data)


class HeldAnswers:
    """Answers that wait, in the order in which they leave."""

    def __init__(self) -> None:
        self._held: deque[tuple[int, SendStream]] = deque()
        self._of_stream: Counter[int] = Counter()
        #: When the drive is done with everything so far.
        self._busy_until = 0

    def put(self, answer: SendStream, work_ns: int, now: int) -> bool:
        """Hold an answer back if it has to wait; False if it may leave at once."""
        if not work_ns and not self._of_stream[answer.stream]:
            return False
        self._busy_until = max(self._busy_until, now) + work_ns
        self._held.append((self._busy_until, answer))
        self._of_stream[answer.stream] += 1
        return True

    def full(self, stream: int) -> bool:
        return self._of_stream[stream] >= MOST_HELD

    def due(self, now: int) -> list[SendStream]:
        """Answers that leave now."""
        found = []
        while self._held and self._held[0][0] <= now:
            found.append(self._held.popleft()[1])
            self._of_stream[found[-1].stream] -= 1
        return found

    def next_deadline(self) -> int | None:
        return self._held[0][0] if self._held else None

    def forget(self, stream: int) -> None:
        """A stream is gone."""
        if self._of_stream.pop(stream, 0):
            self._held = deque(entry for entry in self._held if entry[1].stream != stream)
