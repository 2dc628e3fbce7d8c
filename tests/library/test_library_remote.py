"""What the API of a running farm answers while something changes there."""

from __future__ import annotations

import asyncio
import threading

import anyio
import pytest

import pnfarm
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.library import RemoteDrive


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


class Hub(Client):
    """Answers as a hub with a shard away that has a part of the fault ``half``."""

    def __init__(self) -> None:
        super().__init__()
        self.cleared: list[str] = []
        self.is_open = True

    def _of(self, name: str, state: str) -> dict[str, object]:
        self.states = [state]
        left = ["axis-02"] if name == "half" and state != "waiting" else []
        return {**self._fault(), "id": name, "unreachable": left}

    def post(self, *_: str, body: dict[str, str]) -> dict[str, object]:
        return self._of(body["as"], "waiting")

    def get(self, _: str, name: str = "") -> dict[str, object]:
        return self._of(name, "active") if name else {"faults": [self._of(one, "active") for one in ("half", "whole")]}

    def delete(self, _: str, name: str) -> dict[str, object]:
        self.cleared.append(name)
        return self._of(name, "active" if name == "half" else "ended")

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        self.is_open = False


def test_a_fault_that_a_hub_could_clear_in_part_only_is_an_error_and_others_are_cleared_nevertheless() -> None:
    async def main() -> None:
        farm = pnfarm.Farm.connect("http://127.0.0.1:1")
        farm._client = client
        for name in ("half", "whole"):
            await farm.fault("silence", **{"as": name})
        await farm.close()

    client = Hub()
    with pytest.raises(EnvironmentError_, match="half is in force on axis-02, whose shard does not answer"):
        asyncio.run(main())
    assert client.cleared == ["half", "whole"]
    assert not client.is_open


def test_a_fault_that_the_farm_file_names_has_its_name_elsewhere_too() -> None:
    own = {"number": 4711, "name": "Door open"}
    view = {"name": "a", "model": "profidrive", "faults": [own], "last_fault": own, "warning": None}
    drive = RemoteDrive(pnfarm.Farm.connect("http://127.0.0.1:1"), view)
    for fault in (drive.active_fault, drive.last_fault):
        assert fault == 4711
        assert fault == "Door open"
        assert repr(fault) == "4711 (Door open)"


class SlowClient:
    """Answers a request that begins something once it is released."""

    def __init__(self) -> None:
        self.asked, self.released = threading.Event(), threading.Event()
        self.deleted: list[tuple[str, ...]] = []

    def post(self, *path: str, **_: object) -> dict[str, object]:
        self.asked.set()
        self.released.wait(10)
        return {"id": f"{path[0]}-1"}

    def delete(self, *path: str) -> None:
        self.deleted.append(path)


@pytest.mark.parametrize("by", ["asyncio", "anyio"])
@pytest.mark.parametrize("what", ["faults", "scenarios"])
def test_what_a_cancelled_request_has_begun_is_ended(what: str, by: str) -> None:
    client = SlowClient()

    async def cancelled_while_it_is_asked() -> None:
        farm = pnfarm.Farm.connect("http://127.0.0.1:1")
        farm._client = client

        async def ask() -> None:
            await (farm.fault("f702") if what == "faults" else farm.run_text("scenario: x"))

        async with anyio.create_task_group() as tasks:
            if by == "anyio":
                tasks.start_soon(ask)
            else:
                task = asyncio.ensure_future(ask())
            await asyncio.to_thread(client.asked.wait, 10)
            (tasks.cancel_scope if by == "anyio" else task).cancel()
            asyncio.get_running_loop().call_later(0.01, client.released.set)
        if by == "asyncio":
            with pytest.raises(asyncio.CancelledError):
                await task

    asyncio.run(cancelled_while_it_is_asked())
    assert client.deleted == [(what, f"{what}-1")]


class ClosedClient(SlowClient):
    """Begins a scenario, and is not reached any more."""

    def get(self, *_: str, **__: object) -> dict[str, object]:
        self.asked.set()
        self.released.wait(10)
        raise EnvironmentError_("the first question is not answered")

    def delete(self, *path: str) -> None:
        self.deleted.append(path)
        raise EnvironmentError_("the farm cannot be reached to clean up")


def test_a_lost_farm_hides_neither_a_cancellation_nor_the_first_error() -> None:
    client = ClosedClient()
    client.post = lambda *_, **__: {"id": "scenario-1"}
    farm = pnfarm.Farm.connect("http://127.0.0.1:1")
    farm._client = client

    async def cancelled() -> None:
        task = asyncio.ensure_future(farm.run_text("scenario: x"))
        await asyncio.to_thread(client.asked.wait, 10)
        task.cancel()
        await asyncio.wait([task], timeout=10)
        client.released.set()
        assert task.cancelled()

    asyncio.run(cancelled())
    with pytest.raises(EnvironmentError_, match="the first question"):
        asyncio.run(farm.run_text("scenario: x"))
    assert client.deleted == [("scenarios", "scenario-1")] * 2
