"""The cyclic channels of one AR."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ipaddress import IPv4Address

    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout

__all__ = ["ArChannels"]


@dataclass(slots=True)
class ArChannels:
    """The rows of one AR, and its controller, which gives up after ``hold_ns`` without a frame."""

    initiator: str
    ip: IPv4Address
    mac: bytes
    cycle_ns: int
    watchdog_ns: int
    hold_ns: int
    set_point_cycle_ns: int
    providers: list[tuple[int, IocrLayout]] = field(default_factory=list)
    consumers: list[tuple[int, IocrLayout]] = field(default_factory=list)
    expected: frozenset[ExpectedKey] = frozenset()
    unusable: frozenset[ExpectedKey] = frozenset()
    #: The application has been ready; until then all data are BAD.
    ready: bool = False
    #: The axes, by number, whose set points come from this AR; 0 stands for a station without axes.
    feeds: frozenset[int] = frozenset()
    established: bool = False
    connected_ns: int = 0
    #: What the consumers reported last, by the kind of the engine's event and their rows.
    reported: dict[int, dict[int, int]] = field(default_factory=dict)

    @property
    def bad(self) -> frozenset[ExpectedKey]:
        """Submodules whose data cannot be used, in either direction."""
        return self.unusable if self.ready else self.expected

    def worst(self, kind: int, row: int, value: int) -> int | None:
        """A consumer reports another value: the least of all consumers' if that changes, else None."""
        known = self.reported.setdefault(kind, {})
        before = min(known.values(), default=None)
        known[row] = value
        after = min(known.values())
        return None if len(known) > 1 and after == before else after
