"""EtherNet/IP's part of ``pnfarm import --check``: ListIdentity to everyone at an interface."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.buses.checking import CheckAnswer, CheckQuestion

__all__ = ["read_stations"]


async def read_stations(question: CheckQuestion) -> CheckAnswer:
    """Raises :class:`~pnfarm.errors.EnvironmentError_` for an interface that cannot ask."""
    from pnfarm.buses.ethernetip.checking import seen
    from pnfarm.buses.ethernetip.commands.scan import MOST_DEVICES, ask_everyone, twice
    from pnfarm.buses.search import Question
    from pnfarm.errors import EnvironmentError_

    # as many others as there may be in a search
    most = MOST_DEVICES + len(question.expected)
    found = await ask_everyone(Question(question.interface, question.seconds, 0.0), most)
    if isinstance(found, str):
        raise EnvironmentError_(found)
    return replace(seen(found), remarks=tuple(twice(found)))
