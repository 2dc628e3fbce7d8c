"""What each kind of fault does to one drive.

An :class:`Effect` is begun once, told when something may have happened on its drive (:meth:`Effect.check`), and ended
once; ending undoes what it did.  Effects on frames are here; those on connections, records and the drive itself in
:mod:`pnfarm.buses.profinet.faults.effects_connection` and :mod:`pnfarm.faults.effects_drive`.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from pnfarm.faults.gate import GateRule, every_frame, is_dcp, is_rpc
from pnfarm.faults.target import NOTHING, Evidence
from pnfarm.station.splitmix import SplitMix64
from pnfarm.table.impairment import DATA_INVALID, IOPS_BAD, LOSS, PROVIDER_STOP

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.faults.plan import FaultSpec
    from pnfarm.faults.target import FaultTarget, Way

__all__ = ["Effect", "FramesEffect", "IopsEffect", "LinkEffect", "Tally", "TimeoutEffect", "Window", "seed_of"]

#: The longest time between two looks at an effect that waits for its end without knowing when.
POLL_NS = 50_000_000
#: Cycles of silence beyond the watchdog time: the controller looks once a cycle, and its frame travels.
MARGIN_CYCLES = 2


def seed_of(spec: FaultSpec, drive: str) -> int:
    """A drive's own seed: other for each drive, the same whenever the fault's seed is."""
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

    def __init__(self, spec: FaultSpec, target: FaultTarget, count: int | None) -> None:
        self._probability = 1.0 if spec.probability is None else spec.probability
        self._random = SplitMix64(seed_of(spec, target.name))
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
    """When a fault on frames is in force: nanoseconds, ``stop_ns`` 0 for no end, ``after`` healthy frames first."""

    def __init__(self, start_ns: int = 0, stop_ns: int = 0, after: int = 0) -> None:
        self.start_ns = start_ns
        self.stop_ns = stop_ns
        self.after = after


class Effect(ABC):
    """The parts that every effect has; see the module's head."""

    #: Whether the effect itself lets ``after_cycles`` healthy frames pass, exact to the frame.
    counts_frames = False

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        self.spec = spec
        self.target = target
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


#: What a kind does to cyclic frames (None: nothing) and which acyclic ones it loses (None: none).
_FRAMES: dict[str, tuple[int | None, Callable[[bytes], bool] | None]] = {
    "loss": (LOSS, every_frame),
    "silence": (LOSS, every_frame),
    "timeout": (LOSS, every_frame),
    "link-down": (LOSS, every_frame),
    "link-flap": (LOSS, every_frame),
    "provider-stop": (PROVIDER_STOP, None),
    "data-invalid": (DATA_INVALID, None),
    "iops-bad": (IOPS_BAD, None),
    "rpc-silence": (None, is_rpc),
    "dcp-silence": (None, is_dcp),
}


class Frames:
    """Rows of the engine and a rule of the gate that act together on one drive's frames."""

    def __init__(self, spec: FaultSpec, target: FaultTarget, ways: tuple[Way, ...]) -> None:
        self._spec = spec
        self._target = target
        self._ways = ways
        self._cyclic, self._selects = _FRAMES[spec.kind]
        wanted = spec.params.get("frames", "all")
        if wanted == "acyclic":
            self._cyclic = None
        elif wanted == "cyclic":
            self._selects = None
        self._rows: dict[int, Way] = {}
        self._rule: GateRule | None = None
        self._done = NOTHING
        self._after = 0

    @property
    def cyclic(self) -> bool:
        """Whether it acts on cyclic frames."""
        return self._cyclic is not None

    def begin(self, window: Window) -> None:
        probability = 1.0 if self._spec.probability is None else self._spec.probability
        seed = seed_of(self._spec, self._target.name)
        self._after = window.after
        try:
            for index, way in enumerate(self._ways if self._cyclic is not None else ()):
                number = self._target.impair(
                    way,
                    self._cyclic or 0,
                    probability=probability,
                    seed=seed + index,
                    count=self._spec.count or 0,
                    after=window.after,
                    start_ns=window.start_ns,
                    stop_ns=window.stop_ns,
                )
                self._rows[number] = way
            if self._spec.count and len(self._rows) == 2:
                self._target.share_limit(*self._rows)
        except BaseException:
            self.end()
            raise
        if self._selects is not None:
            self._rule = GateRule(
                self._ways,
                self._selects,
                probability=probability,
                seed=seed + 16,
                count=self._spec.count or 0,
                stop_ns=window.stop_ns,
                armed=self._armed,
                spent=self._spent,
                lost=self._gate_lost,
            )
            self._target.gate(self._rule)

    def _spent(self) -> int:
        """Cyclic frames that the engine acted on."""
        return sum(self._target.impairment(row).activations for row in self._rows)

    def _gate_lost(self) -> None:
        """An acyclic frame was lost: so much less is left for the cyclic ones."""
        if self._spec.count and self._rule is not None:
            for number in self._rows:
                self._target.set_limit(number, self._spec.count - self._rule.evidence().activations)

    def _armed(self) -> bool:
        """The engine has let the healthy frames pass."""
        return not self._after or any(self._target.impairment(row).checks > self._after for row in self._rows)

    def end(self) -> None:
        rows, self._rows = self._rows, {}
        for number in rows:
            self._done += self._target.unimpair(number)
        if self._rule is not None:
            self._target.ungate(self._rule)
            self._done += self._rule.evidence()
            self._rule = None

    def evidence(self) -> Evidence:
        seen = self._done
        for number in self._rows:
            seen += self._target.impairment(number)
        return seen if self._rule is None else seen + self._rule.evidence()

    @property
    def remaining(self) -> int:
        """Occurrences that are left of ``count``; 1 while there is no such limit."""
        if self._spec.count is None:
            return 1
        return self._spec.count - self.evidence().activations


class FramesEffect(Effect):
    """Frames lost or changed: loss, silence, provider-stop, data-invalid, rpc-silence, dcp-silence."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._frames = Frames(spec, target, spec.ways)
        self.counts_frames = self._frames.cyclic
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        self._frames.begin(window)
        self.check(now)

    def check(self, now: int) -> None:
        self._due = None
        if self.spec.count is None:
            return
        remaining = self._frames.remaining
        self.finished = remaining <= 0
        connection = self.target.connection()
        if not self.finished and connection is not None and self._frames.cyclic:
            self._due = now + max(1, remaining) * connection.cycle_ns
        elif not self.finished:
            self._due = now + POLL_NS

    def end(self, now: int) -> None:
        del now
        self._frames.end()

    def evidence(self) -> Evidence:
        return self._frames.evidence()

    def next_deadline(self) -> int | None:
        return self._due


class IopsEffect(FramesEffect):
    """iops-bad; ending it on the connection that saw it is a return of the submodules (alarm 0x000B)."""

    def end(self, now: int) -> None:
        super().end(now)
        last = self.evidence().last_ns
        if last is not None:
            self.target.return_of_submodules(last, now)


class TimeoutEffect(Effect):
    """Mute until the controller's watchdog has expired and the connection is gone; then, perhaps, again."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._chance = Chance(spec, target, spec.count if spec.count or spec.for_ns else 1)
        self._frames: Frames | None = None
        self._keys: frozenset[int] = frozenset()
        self._passed: frozenset[int] = frozenset()
        self._earliest = 0
        self._due: int | None = None

    def begin(self, window: Window, now: int) -> None:
        del window
        self.check(now)

    def check(self, now: int) -> None:
        connection = self.target.connection()
        standing = connection.keys if connection else frozenset()
        if self._frames is not None:
            if now < self._earliest or standing & self._keys:
                self._due = self._earliest if now < self._earliest else now + POLL_NS
                return
            self._speak()
            self._chance.tally.confirm()
            self.finished = self._chance.exhausted
        if self._frames is None and connection and connection.established and not standing & self._passed:
            self._passed = standing
            happens = self._chance.falls()
            self._chance.tally.note(now, happened=happens)
            if happens:
                frames = Frames(
                    self.spec.model_copy(update={"probability": None, "count": None}), self.target, ("out",)
                )
                frames.begin(Window())
                self._frames, self._keys = frames, standing
                margin = self.values["margin"]
                if margin is None:
                    margin = MARGIN_CYCLES * connection.cycle_ns
                self._earliest = self._due = now + connection.watchdog_ns + margin

    def _speak(self) -> None:
        if self._frames is not None:
            self._frames.end()
            self._frames = None
        self._due = None

    def end(self, now: int) -> None:
        del now
        self._speak()

    def evidence(self) -> Evidence:
        return self._chance.tally.seen

    def next_deadline(self) -> int | None:
        return self._due


class LinkEffect(Effect):
    """The cable pulled once (link-down) or again and again (link-flap)."""

    def __init__(self, spec: FaultSpec, target: FaultTarget) -> None:
        super().__init__(spec, target)
        self._tally = Tally()
        self._frames: Frames | None = None
        self._due: int | None = None
        self._period: int | None = self.values.get("period")
        self._down: int = self.values.get("down") or (self._period or 0) // 2

    def begin(self, window: Window, now: int) -> None:
        del window
        self._pull(now)

    def _pull(self, now: int) -> None:
        frames = Frames(self.spec.model_copy(update={"count": None}), self.target, ("out", "in"))
        frames.begin(Window())
        self._frames = frames
        self.target.pull_cable()
        self._tally.note(now)
        self._due = now + POLL_NS if self._period is None else now + self._down

    def _plug(self) -> None:
        if self._frames is not None:
            self.target.plug_cable()
            self._frames.end()
            self._frames = None

    def check(self, now: int) -> None:
        if self._frames is not None and self.target.carrier_off:
            self._tally.confirm()
            if self._period is None:
                self._due = None
        if self._due is None or now < self._due:
            return
        if self._period is None:
            self._due = now + POLL_NS
        elif self._frames is not None:
            self._plug()
            self.finished = self.spec.count is not None and self._tally.seen.activations >= self.spec.count
            self._due = None if self.finished else now + self._period - self._down
        else:
            self._pull(now)

    def end(self, now: int) -> None:
        del now
        self._plug()
        self._due = None

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due
