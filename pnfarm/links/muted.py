"""A link that is silent while its farm has no right to speak: whatever the event loop sends passes here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.links.wrapper import LinkWrapper

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.links.base import Link

__all__ = ["MutedLink"]


class MutedLink(LinkWrapper):
    """``inner``, as long as ``may_speak()`` says so at the moment of each frame; others are counted as dropped."""

    def __init__(self, inner: Link, may_speak: Callable[[], bool]) -> None:
        super().__init__(inner)
        self._may_speak = may_speak

    def send(self, port_index: int, frame: bytes) -> None:
        if self._may_speak():
            self.inner.send(port_index, frame)
        else:
            self.inner.counters.dropped["no-lease"] += 1
