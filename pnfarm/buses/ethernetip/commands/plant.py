"""EtherNet/IP's part of ``pnfarm import --check``: ListIdentity to everyone at an interface."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.buses.plant import PlantAnswer, PlantQuestion

__all__ = ["read_plant"]


async def read_plant(question: PlantQuestion) -> PlantAnswer:
    """Raises :class:`~pnfarm.errors.EnvironmentError_` for an interface that cannot ask."""
    from pnfarm.buses.ethernetip.commands.scan import MOST_DEVICES, ask_everyone, twice
    from pnfarm.buses.ethernetip.plant import seen
    from pnfarm.buses.search import Question
    from pnfarm.errors import EnvironmentError_

    # as many others as there may be in a search
    most = MOST_DEVICES + len(question.expected)
    found = await ask_everyone(Question(question.interface, question.seconds, 0.0), most)
    if isinstance(found, str):
        raise EnvironmentError_(found)
    return replace(seen(found), remarks=tuple(twice(found)))
