"""A wrapper of a link that loses acyclic frames on purpose, and counts what it did.

Faults are no branches in a protocol: a drive that is mute or a lossy cable is this wrapper between the
stations and the link.  (Cyclic frames are impaired by columns of the engine's tables.)  Directions are seen from the
drive: ``in`` is what it would have received.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.links.base import Clock, Link, LinkCounters, Port, PortSpec, Receiver

__all__ = ["Direction", "Evidence", "ImpairedLink", "LinkImpairment", "SplitMix64"]

Direction: TypeAlias = Literal["in", "out", "both"]

_MASK = 0xFFFF_FFFF_FFFF_FFFF


class SplitMix64:
    """A small seeded generator (Steele, Lea, Flood: Fast Splittable Pseudorandom Number Generators, 2014).

    One per impairment: the same seed loses the same frames of a sequence, whatever else happens in the process.
    """

    __slots__ = ("_state",)

    def __init__(self, seed: int) -> None:
        self._state = seed & _MASK

    def next_u64(self) -> int:
        self._state = (self._state + 0x9E3779B97F4A7C15) & _MASK
        z = self._state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
        return z ^ (z >> 31)

    def uniform(self) -> float:
        """In [0, 1)."""
        return (self.next_u64() >> 11) / (1 << 53)


@dataclass(frozen=True, slots=True)
class LinkImpairment:
    """Lose a frame with ``probability``; 1.0 is silence.

    ``ethertype`` narrows it to one kind of frame (0x0806: the drive no longer answers ARP); None means all.
    """

    port: int
    probability: float = 1.0
    direction: Direction = "both"
    seed: int = 0
    ethertype: int | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.probability <= 1.0:
            raise ValueError(f"probability {self.probability}: must lie between 0 and 1")


@dataclass(frozen=True, slots=True)
class Evidence:
    """What an impairment did: frames looked at, frames lost, and when (None: never)."""

    checks: int = 0
    activations: int = 0
    first_ns: int | None = None
    last_ns: int | None = None


@dataclass(slots=True)
class _Active:
    rule: LinkImpairment
    random: SplitMix64
    evidence: Evidence = field(default_factory=Evidence)

    def loses(self, direction: Direction, frame: bytes, now: int) -> bool:
        rule = self.rule
        if rule.direction not in {"both", direction}:
            return False
        if rule.ethertype is not None and int.from_bytes(frame[12:14], "big") != rule.ethertype:
            return False
        lost = self.random.uniform() < rule.probability
        seen = self.evidence
        if lost:
            first = now if seen.first_ns is None else seen.first_ns
            self.evidence = Evidence(seen.checks + 1, seen.activations + 1, first, now)
        else:
            self.evidence = replace(seen, checks=seen.checks + 1)
        return lost


class ImpairedLink:
    """Wraps ``inner``.  ``clock`` stamps the evidence of sent frames; received ones bring their time."""

    def __init__(self, inner: Link, *, clock: Clock = time.monotonic_ns) -> None:
        self.inner = inner
        self._clock = clock
        self._receiver: Receiver | None = None
        self._active: dict[int, _Active] = {}
        self._by_port: dict[int, list[_Active]] = {}
        self._next_key = 1
        inner.set_receiver(self._receive)

    # -- impairments

    def add(self, rule: LinkImpairment) -> int:
        """Put an impairment in force; the key to :meth:`remove` it and to ask for its :meth:`evidence`."""
        key = self._next_key
        self._next_key += 1
        active = _Active(rule, SplitMix64(rule.seed))
        self._active[key] = active
        self._by_port.setdefault(rule.port, []).append(active)
        return key

    def remove(self, key: int) -> Evidence:
        """Take an impairment back; its final evidence.  Raises :class:`KeyError` for a key that is not in force."""
        active = self._active.pop(key)
        remaining = self._by_port[active.rule.port]
        remaining.remove(active)
        if not remaining:
            del self._by_port[active.rule.port]
        return active.evidence

    def evidence(self, key: int) -> Evidence:
        """Raises :class:`KeyError` for a key that is not in force."""
        return self._active[key].evidence

    def _lost(self, port_index: int, direction: Direction, frame: bytes, now: int) -> bool:
        # every impairment looks at every frame, so that each one's sequence does not depend on the others
        verdicts = [active.loses(direction, frame, now) for active in self._by_port.get(port_index, ())]
        return any(verdicts)

    # -- the link

    @property
    def kind(self) -> str:
        return self.inner.kind

    @property
    def counters(self) -> LinkCounters:
        return self.inner.counters

    async def open(self, wanted: Sequence[PortSpec]) -> list[Port]:
        return await self.inner.open(wanted)

    async def close(self) -> None:
        await self.inner.close()

    def send(self, port_index: int, frame: bytes) -> None:
        if port_index in self._by_port and self._lost(port_index, "out", frame, self._clock()):
            return
        self.inner.send(port_index, frame)

    def _receive(self, port_index: int, frame: bytes, now: int) -> None:
        if port_index in self._by_port and self._lost(port_index, "in", frame, now):
            return
        if self._receiver is not None:
            self._receiver(port_index, frame, now)

    def set_receiver(self, receiver: Receiver) -> None:
        self._receiver = receiver

    async def set_carrier(self, port_index: int, up: bool) -> None:
        await self.inner.set_carrier(port_index, up)

    async def set_mac(self, port_index: int, mac: bytes) -> None:
        await self.inner.set_mac(port_index, mac)
