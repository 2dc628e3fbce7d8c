"""What an injection does to one drive.

An :class:`Effect` is begun once, told when something may have happened on its drive (:meth:`Effect.check`), and ended
once; ending undoes what it did.  Bases of effects that several kinds have in common stand beside this file
(:mod:`~pnfarm.faults.frames`, :mod:`~pnfarm.faults.cable`, :mod:`~pnfarm.faults.shown`, :mod:`~pnfarm.faults.breaking`,
:mod:`~pnfarm.faults.late`), the effects themselves with their kinds.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

from pnfarm.faults.evidence import NOTHING, Evidence
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from pnfarm.faults.given import GivenInjection
    from pnfarm.faults.parts import InjectedDrive, Part

__all__ = ["POLL_NS", "Chance", "Effect", "Needs", "Tally", "Window", "seed_of"]

Needs: TypeAlias = "tuple[Part[Any], ...]"

#: The longest time between two looks at an effect that waits for its end without knowing when.
POLL_NS = 50_000_000


def seed_of(spec: GivenInjection, drive: str) -> int:
    """A drive's own seed: other for each drive, the same whenever the injection's seed is."""
    digest = hashlib.sha256(f"{spec.seed or 0}\0{drive}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


class Tally:
    """Counts occurrences."""

    def __init__(self) -> None:
        self.seen = NOTHING

    def note(self, now: int, *, happened: bool = True, confirmed: bool = False) -> None:
        """One occurrence that was possible."""
        self.seen += Evidence(1, 1, now, now, confirmed) if happened else Evidence(1)

    def confirm(self) -> None:
        """It was seen on the wire."""
        self.seen += Evidence(confirmed=True)


class Chance:
    """``probability`` of each occurrence, up to ``count``."""

    def __init__(self, spec: GivenInjection, drive: InjectedDrive, count: int | None) -> None:
        self._probability = 1.0 if spec.probability is None else spec.probability
        self._random = SplitMix64(seed_of(spec, drive.name))
        self._count = count
        self.tally = Tally()

    @property
    def exhausted(self) -> bool:
        """Whether it has happened ``count`` times."""
        return self._count is not None and self.tally.seen.activations >= self._count

    def falls(self) -> bool:
        """Whether the occurrence at hand happens."""
        return not self.exhausted and self._random.uniform() < self._probability


class Window:
    """When frames are acted on: nanoseconds, ``stop_ns`` 0 for no end, ``after`` healthy frames first."""

    def __init__(self, start_ns: int = 0, stop_ns: int = 0, after: int = 0) -> None:
        self.start_ns = start_ns
        self.stop_ns = stop_ns
        self.after = after


class Effect(ABC):
    """The parts that every effect has; see the module's head."""

    #: Parts that a drive must have.
    needs: ClassVar[Needs] = ()
    #: Whether the effect itself lets ``after_cycles`` healthy frames pass, exact to the frame.
    counts_frames = False

    def __init__(self, spec: GivenInjection, drive: InjectedDrive) -> None:
        self.spec = spec
        self.drive = drive
        self.values = spec.values()
        self.finished = False

    @abstractmethod
    def begin(self, window: Window, now: int) -> None:
        """Put it in force.  Raises :class:`ConfigError`, with nothing changed, when this drive cannot do it."""

    def check(self, now: int) -> None:
        """Something may have happened; sets ``finished`` once nothing more will."""
        del now

    def end(self, now: int) -> None:
        """Undo it."""
        del now

    def evidence(self) -> Evidence:
        """What it did until now, or did."""
        return NOTHING

    def next_deadline(self) -> int | None:
        """When :meth:`check` is wanted."""
        return None
