"""What the API of a running farm answers while something changes there."""

from __future__ import annotations

import asyncio

import pytest

import pnfarm
from pnfarm.errors import ConfigError


class Client:
    """Answers for one fault, which is in another state with each question."""

    def __init__(self, *states: str) -> None:
        self.states = list(states)

    def _fault(self) -> dict[str, object]:
        evidence = {"checks": 0, "activations": 0, "first_seconds": None, "last_seconds": None, "confirmed": False,
                    "confirmation": "inconclusive", "reason": ""}  # fmt: skip
        return {"id": "trip", "kind": "f702", "drives": [], "state": self.states.pop(0), "evidence": evidence}

    def post(self, *_: str, **__: object) -> dict[str, object]:
        return self._fault()

    get = post

    def delete(self, *_: str) -> dict[str, object]:
        raise ConfigError("there is no injection 'trip'; none is in force")


def clear(*states: str) -> str:
    async def main() -> str:
        farm = pnfarm.Farm.connect("http://127.0.0.1:1")
        farm._client = Client(*states)
        fault = await farm.fault("f702", count=1)
        await fault.clear()
        return fault.state

    return asyncio.run(main())


def test_a_fault_that_ends_just_before_it_is_cleared_is_over() -> None:
    assert clear("active", "active", "ended") == "ended"


def test_a_fault_that_cannot_be_cleared_and_has_not_ended_is_an_error() -> None:
    with pytest.raises(ConfigError, match="no injection 'trip'"):
        clear("active", "active", "active")
