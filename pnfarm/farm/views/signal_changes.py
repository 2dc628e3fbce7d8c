"""The signals of a device for viewers that follow them: what changed since they read last.

Nothing runs between readings.  Each change has the revision at which it was seen, so that a viewer that gives the
revision of its last reading costs no memory here, and several viewers share what one of them read.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.farm.views.stations import signal_states

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.station.plain_signals import NamedSignals

__all__ = ["SignalChanges"]

#: What was read so short a time ago is good for another viewer.
SHARED_NS = 50_000_000


class SignalChanges:
    """``now`` is the farm's clock, ns.  ``revision`` is the one of the last reading."""

    def __init__(self, signals: NamedSignals, now: Callable[[], int]) -> None:
        self._signals = signals
        self._now = now
        self._looked_ns: int | None = None
        self.revision = -1
        self._states: list[dict[str, Any]] = [{}] * len(signals.names)
        #: The revision at which each of them changed last.
        self._changed = [-1] * len(signals.names)

    def __len__(self) -> int:
        return len(self._states)

    def look(self) -> int:
        """Read the signals if they may have changed; the revision."""
        now = self._now()
        if self._looked_ns is None or not 0 <= now - self._looked_ns < SHARED_NS:
            self._looked_ns = now
            # before the values: what changes meanwhile has a revision of its own
            revision = self._signals.revision
            if revision != self.revision:
                self.revision = revision
                for place, (_, state) in enumerate(signal_states(self._signals)):
                    if state != self._states[place]:
                        self._states[place] = state
                        self._changed[place] = revision
        return self.revision

    def since(self, revision: int) -> list[dict[str, Any]]:
        """What moved after ``revision``, up to the last reading; -1 is the revision of who has seen nothing."""
        return [state for state, at in zip(self._states, self._changed, strict=True) if at > revision]
