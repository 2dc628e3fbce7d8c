"""The signals of the devices that one client of ``GET live`` has chosen, as messages ``values``."""

from __future__ import annotations

import json
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.api.messages import message

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from pnfarm.farm.views.signal_changes import SignalChanges

__all__ = ["Followed", "values_messages"]

#: Signals of devices that changed, in one round: those of the others are in the next.  One device is always whole.
MOST_SIGNALS = 1000
#: Octets of signals in one message, about.
MOST_OCTETS = 50_000


def values_messages(device: str, revision: int, tag: str, signals: Iterable[dict[str, Any]]) -> Iterator[bytes]:
    """These states of signals; one message at least."""
    head = f'{{"device":{json.dumps(device)},"revision":{revision},"tag":{json.dumps(tag)},"signals":['.encode()
    texts: list[bytes] = []
    octets = 0
    for state in signals:
        if octets > MOST_OCTETS:
            yield message("values", b"%b%b]}" % (head, b",".join(texts)))
            texts, octets = [], 0
        texts.append(json.dumps(state, separators=(",", ":")).encode())
        octets += len(texts[-1])
    yield message("values", b"%b%b]}" % (head, b",".join(texts)))


@dataclass(slots=True)
class _Device:
    name: str
    changes: SignalChanges
    seen: int = -1


class Followed:
    """``tag`` gives the ETag of a revision."""

    def __init__(self, devices: Iterable[tuple[str, SignalChanges]], tag: Callable[[int], str]) -> None:
        self._devices = deque(_Device(name, changes) for name, changes in devices)
        self._tag = tag
        self._left = 0

    def messages(self, *, whole: bool = False) -> Iterator[bytes]:
        """What changed since the round before; with ``whole`` of all devices at once."""
        # a device with more signals uses up the following rounds as well
        self._left = min(self._left, 0) + MOST_SIGNALS
        for _ in range(len(self._devices)):
            if self._left <= 0 and not whole:
                return
            device = self._devices[0]
            self._devices.rotate(-1)
            revision = device.changes.look()
            if revision != device.seen:
                self._left -= len(device.changes)
                found = device.changes.since(device.seen)
                device.seen = revision
                yield from values_messages(device.name, revision, self._tag(revision), found)
