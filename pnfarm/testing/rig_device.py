"""One device of a rig: every reading asks the farm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Iterator

    from pnfarm.library import Device, RemoteDevice
    from pnfarm.wire.value_types import Value

    #: Carries out a coroutine in the rig's thread.
    Call = Callable[[Coroutine[Any, Any, Any]], Any]

__all__ = ["RigDevice"]


class RigSignals(Mapping[str, "Value"]):
    """The values, as :class:`pnfarm.library.device_readings.Signals` has them."""

    def __init__(self, call: Call, device: Device | RemoteDevice) -> None:
        self._call = call
        self._device = device

    def _read(self) -> Mapping[str, Value]:
        async def read() -> dict[str, Value]:
            # in the rig's thread, where the farm changes
            return dict((await self._device.refresh()).signals)

        found: Mapping[str, Value] = self._call(read())
        return found

    def __getitem__(self, name: str) -> Value:
        return self._read()[name]

    def __setitem__(self, name: str, value: Value) -> None:
        self.set({name: value})

    def __iter__(self) -> Iterator[str]:
        return iter(self._read())

    def __len__(self) -> int:
        return len(self._read())

    def set(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Write several, all in force at once, or none; returns those that a fault or a force has."""
        return dict(self._call(self._device.write(values)))


class RigDevice:
    """``call`` carries out a coroutine in the rig's thread."""

    def __init__(self, call: Call, device: Device | RemoteDevice) -> None:
        self._call = call
        self._device = device
        #: Its signals by name; ``device.signals["part_present"] = True`` writes one.
        self.signals = RigSignals(call, device)

    @property
    def name(self) -> str:
        return self._device.name

    @property
    def connected(self) -> bool:
        """Whether it exchanges data with its controller."""
        return bool(self.snapshot()["connected"])

    def snapshot(self) -> Mapping[str, Any]:
        """Everything at once, as ``GET devices/{name}`` gives it."""

        async def read() -> Mapping[str, Any]:
            return (await self._device.refresh()).snapshot()

        found: Mapping[str, Any] = self._call(read())
        return found

    def force(self, values: Mapping[str, Value]) -> dict[str, str]:
        """Values over what is written, until :meth:`release`; returns those that a fault has."""
        return dict(self._call(self._device.force(values)))

    def release(self, *names: str) -> None:
        """End the force of these inputs, or of all: what was written meanwhile is in force."""
        self._call(self._device.release(*names))

    def wait_for(self, name: str, value: Value | Callable[[Value], object], within: float | str) -> float:
        """Until a signal has a value, or one that a function accepts; how long it took, s."""
        return float(self._call(self._device.wait_for(name, value, within)))

    def __repr__(self) -> str:
        return repr(self._device)
