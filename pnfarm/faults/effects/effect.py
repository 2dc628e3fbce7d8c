"""What an injection does to one drive.

An :class:`Effect` is begun once, called when something may have happened on its drive (:meth:`Effect.check`), and ended
once; ending undoes what it did.  Bases of effects that several kinds share are in modules beside this one
(:mod:`frames`, :mod:`cable`, :mod:`confirmed`, :mod:`breaking`, :mod:`late`), the effects themselves are with their
kinds.
"""

from __future__ import annotations

import dataclasses
import hashlib
from abc import ABC
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

from pnfarm.faults.effects.evidence import NOTHING, Evidence
from pnfarm.faults.effects.parts import Part
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InForce, InjectedDrive

__all__ = ["POLL_NS", "ChanceEffect", "Effect", "Held", "Tally", "Window", "seed_of"]

#: A list of the drive, and what an effect puts into it; None for an effect that does something else.
Held: TypeAlias = "tuple[InForce[Any], Any] | None"
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


class Window:
    """Time window for acting on frames: nanoseconds, ``stop_ns`` 0 for no end, ``after`` healthy frames first."""

    def __init__(self, start_ns: int = 0, stop_ns: int = 0, after: int = 0) -> None:
        self.start_ns = start_ns
        self.stop_ns = stop_ns
        self.after = after


class Effect(ABC):  # noqa: B024 - what an effect overrides is its own choice
    """Base of all effects; see the module's docstring.

    Parts of the drive are attributes of the class: with ``wire = WIRE`` the effect needs a wire, and ``self.wire`` is
    the drive's.  An effect overrides :meth:`held`; or :meth:`put` and :meth:`take`; or :meth:`begin` and :meth:`end`
    where it needs the time.
    """

    #: Parts that a drive must have: those of the class's bases, then its own.
    needs: ClassVar[tuple[Part[Any], ...]] = ()
    _parts: ClassVar[dict[str, Part[Any]]] = {}
    #: Whether the effect itself lets ``after_cycles`` healthy frames pass, exact to the frame.
    counts_frames = False
    #: Whether it is over after an occurrence without any common field that ends it.
    ends_by_itself = False

    def __init_subclass__(cls) -> None:
        cls._parts = cls._parts | {name: part for name, part in vars(cls).items() if isinstance(part, Part)}
        cls.needs = tuple(dict.fromkeys(cls._parts.values()))

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        self.spec = spec
        self.drive = drive
        self.values = spec.values()
        self.tally = Tally()
        self.finished = False
        #: When it acts on frames; set before it begins.
        self.window = Window()
        self._due: int | None = None
        self.prepare()

    def prepare(self) -> None:  # noqa: B027 - most need nothing
        """Read the parameters. Raises :class:`ConfigError` when this drive cannot do it."""

    def held(self) -> Held:
        """What is in force from start to end, after the list of the drive that it is in."""
        return None

    def put(self) -> None:
        """Do it. Raises :class:`ConfigError`, with nothing changed, when this drive cannot do it."""
        if (held := self.held()) is not None:
            held[0].put(held[1])

    def take(self) -> None:
        """Undo it."""
        if (held := self.held()) is not None:
            held[0].take(held[1])

    def begin(self, now: int) -> None:
        """Begin; raises as :meth:`put`."""
        del now
        self.put()

    def check(self, now: int) -> None:
        """Something may have happened; sets ``finished`` once nothing more can."""
        del now

    def end(self, now: int) -> None:
        """Undo it."""
        del now
        self.take()

    def evidence(self) -> Evidence:
        """The evidence so far, or at its end."""
        return self.tally.seen

    def next_deadline(self) -> int | None:
        """When :meth:`check` is due."""
        return self._due


class ChanceEffect(Effect):
    """Each occurrence with ``probability``, up to ``count``; ``once``: without count and for one."""

    once = False

    def prepare(self) -> None:
        spec = self.spec
        self._probability = 1.0 if spec.probability is None else spec.probability
        self._random = SplitMix64(seed_of(spec, self.drive.name))
        self._count = 1 if self.once and not (spec.count or spec.for_ns) else spec.count

    @property
    def exhausted(self) -> bool:
        """Whether it has happened ``count`` times."""
        return self._count is not None and self.tally.seen.activations >= self._count

    def happens(self) -> bool:
        """Whether the present occurrence happens."""
        return not self.exhausted and self._random.uniform() < self._probability

    def occurs(self, now: int) -> bool:
        """As :meth:`happens`, counted; what happens is seen on the wire."""
        if self.finished:
            return False
        happens = self.happens()
        self.tally.note(now, happened=happens, confirmed=happens)
        self.finished = self.exhausted
        return happens
