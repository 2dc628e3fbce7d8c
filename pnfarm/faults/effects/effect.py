"""What an injection does to one drive.

An :class:`Effect` is begun once, called when something may have happened on its drive (:meth:`Effect.check`), and ended
once; ending undoes what it did.  Bases of effects that several kinds share are in modules beside this one
(:mod:`frames`, :mod:`cable`, :mod:`confirmed`, :mod:`breaking`, :mod:`late`), the effects themselves are with their
kinds.
"""

from __future__ import annotations

import dataclasses
import hashlib
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

from pnfarm.faults.effects.evidence import NOTHING, Evidence
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive, Part

__all__ = ["POLL_NS", "Chance", "Effect", "Needs", "Tally", "Window", "seed_of"]

Needs: TypeAlias = "tuple[Part[Any], ...]"

#: Longest interval between two checks of an effect whose end is not known in advance.
POLL_NS = 50_000_000


def seed_of(spec: InjectionFields, drive: str) -> int:
    """A drive's own seed: different for each drive and kind, determined by the injection's seed.

    Faults of several kinds with one seed on one drive so hit different frames.
    """
    digest = hashlib.sha256(f"{spec.seed or 0}\0{spec.kind.name}\0{drive}".encode()).digest()
    return int.from_bytes(digest[:8], "big")


class Tally:
    """Counts occurrences."""

    def __init__(self) -> None:
        self.seen = NOTHING

    def note(self, now: int, *, happened: bool = True, confirmed: bool = False) -> None:
        """Count one possible occurrence."""
        self.seen += Evidence(1, 1, now, now, confirmed) if happened else Evidence(1)

    def confirm(self) -> None:
        """Note that it was seen on the wire."""
        self.seen = dataclasses.replace(self.seen, confirmed=True, contradicted="")

    def contradict(self, what: str) -> None:
        """Note that the wire shows something else."""
        self.seen = dataclasses.replace(self.seen, confirmed=False, contradicted=what)


class Chance:
    """``probability`` of each occurrence, up to ``count``."""

    def __init__(self, spec: InjectionFields, drive: InjectedDrive, count: int | None) -> None:
        self._probability = 1.0 if spec.probability is None else spec.probability
        self._random = SplitMix64(seed_of(spec, drive.name))
        self._count = count
        self.tally = Tally()

    @property
    def exhausted(self) -> bool:
        """Whether it has happened ``count`` times."""
        return self._count is not None and self.tally.seen.activations >= self._count

    def happens(self) -> bool:
        """Whether the occurrence at hand happens."""
        return not self.exhausted and self._random.uniform() < self._probability


class Window:
    """Time window for acting on frames: nanoseconds, ``stop_ns`` 0 for no end, ``after`` healthy frames first."""

    def __init__(self, start_ns: int = 0, stop_ns: int = 0, after: int = 0) -> None:
        self.start_ns = start_ns
        self.stop_ns = stop_ns
        self.after = after


class Effect(ABC):
    """Base of all effects; see the module's docstring."""

    #: Parts that a drive must have.
    needs: ClassVar[Needs] = ()
    #: Whether the effect itself lets ``after_cycles`` healthy frames pass, exact to the frame.
    counts_frames = False
    #: Whether it is over after an occurrence without any common field that ends it.
    ends_by_itself = False

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        self.spec = spec
        self.drive = drive
        self.values = spec.values()
        self.finished = False

    @abstractmethod
    def begin(self, window: Window, now: int) -> None:
        """Begin. Raises :class:`ConfigError`, with nothing changed, when this drive cannot do it."""

    def check(self, now: int) -> None:
        """Something may have happened; sets ``finished`` once nothing more can."""
        del now

    def end(self, now: int) -> None:
        """Undo it."""
        del now

    def evidence(self) -> Evidence:
        """The evidence so far, or at its end."""
        return NOTHING

    def next_deadline(self) -> int | None:
        """When :meth:`check` is due."""
        return None
