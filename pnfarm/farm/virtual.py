"""Two nodes on a memory switch in virtual time: an hour of farm time in seconds, with the bytes of a real wire.

Cyclic frames are exchanged inside compiled code; acyclic ones travel through the switch.  Time only moves in
:meth:`VirtualWorld.run`, so that every run is the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pnfarm.engine.virtual import run_alone, run_virtual
from pnfarm.errors import InternalError
from pnfarm.links.memory import MemoryLink, MemorySwitch
from pnfarm.wire.mac import mac_to_int

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pnfarm.farm.core import Node
    from pnfarm.links.base import Port

__all__ = ["VirtualClock", "VirtualWorld"]

#: Where virtual time begins: not at zero, which means "never" in several columns.
EPOCH_NS = 1_000_000_000_000


class VirtualClock:
    """The time that everybody in one world reads."""

    def __init__(self, now: int = EPOCH_NS) -> None:
        self.now = now

    def __call__(self) -> int:
        return self.now


class VirtualWorld:
    """A switch, a clock, a farm and perhaps a controller.

    Make links with :meth:`link`, nodes on their ports, then :meth:`join` them and :meth:`run`.
    """

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.switch = MemorySwitch()
        self._nodes: list[Node] = []
        self._addresses: list[tuple[np.ndarray, np.ndarray]] = []

    @property
    def now(self) -> int:
        """Nanoseconds."""
        return self.clock.now

    def link(self) -> MemoryLink:
        """A link on this world's switch."""
        return MemoryLink(self.switch, self.clock)

    def join(self, node: Node, ports: Sequence[Port]) -> None:
        """Put a node into the world; the first is the farm, the second its controller."""
        if len(self._nodes) == 2:
            raise InternalError("a virtual world has two ends: a farm and a controller")
        pairs = sorted((mac_to_int(port.mac), port.index) for port in ports)
        addresses = np.array([mac for mac, _ in pairs], np.int64)
        indexes = np.array([index for _, index in pairs], np.int32)
        self._nodes.append(node)
        self._addresses.append((addresses, indexes))

    def run(self, seconds: float, *, until: Callable[[], bool] | None = None) -> bool:
        """Let time pass; stops early, and says True, once ``until`` holds (looked at whenever something happened)."""
        end = self.now + round(seconds * 1e9)
        self._settle()
        while True:
            if until is not None and until():
                return True
            if self.now >= end:
                return False
            deadlines = [d for node in self._nodes if (d := node.next_deadline()) is not None]
            flying = self.switch.next_deadline()
            if flying is not None:
                deadlines.append(flying)
            target = max(self.now, min([end, *deadlines]))
            self.clock.now = self._cyclic(target)
            self._settle()

    def _cyclic(self, target: int) -> int:
        """Ticks up to ``target``, or to the first event."""
        if target <= self.now:
            return self.now
        if len(self._nodes) == 1:
            return run_alone(self._nodes[0].columns, self.now, target)
        (farm, controller), (here, there) = self._nodes, self._addresses
        return run_virtual(farm.columns, controller.columns, *here, *there, self.now, target)

    def _settle(self) -> None:
        """Everything acyclic that belongs to this instant."""
        for _ in range(1000):
            delivered = self.switch.deliver(self.now)
            for node in self._nodes:
                node.service(self.now)
            flying = self.switch.next_deadline()
            due = [d for node in self._nodes if (d := node.next_deadline()) is not None and d <= self.now]
            if not delivered and not due and (flying is None or flying > self.now):
                return
        raise InternalError("the virtual world does not come to rest: a machine asks to be called again and again")
