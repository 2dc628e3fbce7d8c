"""A device of a farm in another process, by its API."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any, Protocol, Self

import anyio

from pnfarm.config.device import read_place
from pnfarm.farm.views.stations import json_value
from pnfarm.farm.wait import NotInTime, require_in_time
from pnfarm.library.arguments import duration_ns
from pnfarm.library.device_readings import read_back
from pnfarm.signals.layers import EVERY
from pnfarm.signals.refusal import SignalError
from pnfarm.signals.signal import Signal
from pnfarm.vocabulary.quoting import did_you_mean, shortened
from pnfarm.wire.value_types import read_type

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.terminal.client import FarmClient
    from pnfarm.wire.value_types import Value

__all__ = ["RemoteDevice"]

#: Between two questions of a wait.
ASK_SECONDS = 0.02


class Asker(Protocol):
    """What asks a farm's API."""

    @property
    def client(self) -> FarmClient: ...

    async def ask(self, method: Callable[..., Any], *path: str, **options: Any) -> Any: ...


class RemoteDevice:
    """A device: readings are those of the last :meth:`refresh`."""

    def __init__(self, farm: Asker, view: Mapping[str, Any]) -> None:
        self._farm = farm
        #: As ``GET devices`` or ``GET devices/{name}`` gave it.
        self.view = view
        self.name = str(view["name"])

    async def refresh(self) -> Self:
        """Read it again."""
        self.view = await self._farm.ask(self._farm.client.get, "devices", self.name)
        return self

    @property
    def connected(self) -> bool:
        """Whether it exchanges data with its controller."""
        return bool(self.view["connected"])

    def snapshot(self) -> dict[str, Any]:
        """Everything at once."""
        return dict(self.view)

    @property
    def signals(self) -> dict[str, Value]:
        """The values by name, after a :meth:`refresh`; :meth:`write` writes."""
        return {name: signal.taken(value) for name, (signal, value) in self._known().items()}

    def good(self, name: str) -> bool:
        """Whether the provider status of its data is GOOD."""
        self._signal(name)
        return any(one["good"] for one in self.view["signals"] if one["name"] == name)

    def owner(self, name: str) -> str:
        """Whose value it has: ``controller``, ``fault``, ``force``, ``value``, ``default``."""
        self._signal(name)
        return next(str(one["owner"]) for one in self.view["signals"] if one["name"] == name)

    async def write(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Write inputs of the controller, all in force at once, or none; returns those that a fault or force has."""
        return await self._patch({name: json_value(value) for name, value in values.items()}, "value")

    async def force(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Values over what is written, until :meth:`release`; returns those that a fault has."""
        return await self._patch({name: json_value(value) for name, value in values.items()}, "force")

    async def release(self, *names: str) -> None:
        """End the force of these inputs, or of all: what was written meanwhile is in force."""
        await self._patch(dict.fromkeys(names or (EVERY,)), "force")

    async def _patch(self, body: Mapping[str, Any], how: str) -> dict[str, str]:
        client = self._farm.client
        answer = await self._farm.ask(client.patch, "devices", self.name, "signals", body=body, query={"as": how})
        await self.refresh()
        return dict(answer["overruled"])

    async def wait_for(self, name: str, value: Value | Callable[[Value], object], within: float | str) -> float:
        """As :meth:`pnfarm.library.Device.wait_for`; the farm is asked every 20 ms."""
        within_ns = duration_ns(within, "within")
        await self.refresh()
        wanted = None if callable(value) else read_back(self._signal(name)[0], value)
        began = asyncio.get_running_loop().time()
        while True:
            signal, found = self._signal(name)
            present = signal.taken(found)
            took = asyncio.get_running_loop().time() - began
            if value(present) if callable(value) else present == wanted:
                return require_in_time(name, took * 1e9, within_ns)
            if took * 1e9 >= within_ns:
                now = f"{signal.show(present)}{f' {signal.unit}' if signal.unit else ''}"
                raise NotInTime(
                    f"{name} did not become {value!r} within {within_ns / 1e9:g} s: {self.name}.{name} = {now}"
                )
            await anyio.sleep(ASK_SECONDS)
            await self.refresh()

    def _known(self) -> dict[str, tuple[Signal, Value]]:
        return {str(one["name"]): (_signal(one), one["value"]) for one in self.view.get("signals", ())}

    def _signal(self, name: str) -> tuple[Signal, Value]:
        known = self._known()
        if name not in known:
            near = did_you_mean(name, known)
            raise SignalError([(name, f"is not a signal{near}", "" if near else shortened(list(known)) or "none")])
        return known[name]

    def __repr__(self) -> str:
        return f"<RemoteDevice {self.name}, {'connected' if self.connected else 'not connected'}>"


def _signal(view: Mapping[str, Any]) -> Signal:
    slot, subslot, octet, bit = read_place(view["place"])
    kind = read_type(view["type"])
    return Signal(view["name"], view["direction"], slot, subslot, octet, kind, bit, view["unit"], view["scale"])
