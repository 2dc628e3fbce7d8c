"""An FMU that is loaded into this process, through FMPy."""

from __future__ import annotations

import contextlib
import math
from ctypes import byref
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE, fmi2Terminated
from fmpy.fmi3 import FMU3Slave
from fmpy.logging import addLoggerProxy

from pnfarm.plant.fmi.memory import STEP_SECONDS, TIME, VALUES

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["LoadedFmu"]

#: Longest text of a message of an FMU.
MAX_TEXT = 300
_DISCARD, _ERROR = 2, 3


class LoadedFmu:
    """``order``: what :class:`pnfarm.plant.fmi.process.FmuProcess` says of it; ``memory``: the shared numbers.

    It is unpacked to ``order["folder"]``.  All methods raise what FMPy raises.
    """

    def __init__(self, order: dict[str, Any], memory: Any) -> None:
        self._memory = memory
        #: The last error that the FMU itself reported.
        self.message = ""
        self._inputs = _groups(order["inputs"], VALUES)
        self._outputs = _groups(order["outputs"], VALUES + len(order["inputs"]))
        folder = order["folder"]
        kind = FMU2Slave if order["version"] == 2 else FMU3Slave
        self._fmu: Any = kind(
            guid=order["token"],
            modelIdentifier=order["identifier"],
            unzipDirectory=folder,
            instanceName=order["name"],
            **({"libraryPath": str(Path(folder, order["library"]))} if order["version"] == 2 else {}),
        )

    def start(self, order: dict[str, Any]) -> None:
        """Make its instance with its start values; outputs to the memory."""
        if order["version"] == 2:
            self._callbacks = fmi2CallbackFunctions()
            self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log2)
            self._callbacks.allocateMemory = defaultCallbacks.allocateMemory
            self._callbacks.freeMemory = defaultCallbacks.freeMemory
            # formats the messages
            addLoggerProxy(byref(self._callbacks))
            self._fmu.instantiate(callbacks=self._callbacks)
        else:
            self._fmu.instantiate(logMessage=self._log3)
        for type_, reference, value in order["parameters"]:
            getattr(self._fmu, f"set{type_}")([reference], [value])
        if order["version"] == 2:
            self._fmu.setupExperiment(startTime=0.0)
        self._fmu.enterInitializationMode()
        self._put()
        self._fmu.exitInitializationMode()
        self.take()

    def step(self) -> bool:
        """Inputs from the memory, a step, outputs to it; whether it asks for the end of the simulation."""
        self._put()
        asks_for_end = False
        try:
            # the last: whether no state of before is put back any more
            how = self._fmu.doStep(self._memory[TIME], self._memory[STEP_SECONDS], False)
            if how is not None:
                _, asks_for_end, is_early, _ = how
                if is_early and not asks_for_end:
                    raise RuntimeError("it ended a step early, which it was not allowed")
        except FMICallException as error:
            # FMI 2.0.5, clause 4.2.2
            if error.status != _DISCARD or not hasattr(self._fmu, "getBooleanStatus"):
                raise
            asks_for_end = self._fmu.getBooleanStatus(fmi2Terminated)
            if not asks_for_end:
                raise
        self.take()
        return bool(asks_for_end)

    def _put(self) -> None:
        memory = self._memory
        for type_, references, places, limits in self._inputs:
            values = [_fitting(memory[place], *one) for place, one in zip(places, limits, strict=True)]
            getattr(self._fmu, f"set{type_}")(references, values)

    def take(self) -> None:
        """Outputs to the memory."""
        memory = self._memory
        for type_, references, places, _ in self._outputs:
            for place, value in zip(places, getattr(self._fmu, f"get{type_}")(references), strict=True):
                memory[place] = value

    def save(self) -> bytes:
        """Its state."""
        state = self._fmu.getFMUState()
        try:
            return bytes(self._fmu.serializeFMUState(state))
        finally:
            self._fmu.freeFMUState(state)

    def restore(self, octets: bytes) -> None:
        """A state of :meth:`save`."""
        state = self._fmu.deserializeFMUState(octets)
        try:
            self._fmu.setFMUState(state)
        finally:
            self._fmu.freeFMUState(state)
        self.take()

    def close(self) -> None:
        """End it, as far as it lets itself."""
        with contextlib.suppress(FMICallException):
            self._fmu.terminate()
        self._fmu.freeInstance()

    def _log2(self, _: Any, __: bytes, status: int, ___: bytes, message: bytes) -> None:
        self._note(status, message)

    def _log3(self, _: Any, status: int, __: bytes, message: bytes) -> None:
        self._note(status, message)

    def _note(self, status: int, message: bytes | None) -> None:
        if status >= _ERROR and message:
            self.message = " ".join(message[: 4 * MAX_TEXT].decode("utf-8", "replace").split())[:MAX_TEXT]


def _groups(variables: Iterable[list[Any]], first: int) -> list[tuple[str, list[int], list[int], list[Any]]]:
    """Variables ``[type, reference, low, high]`` by type: references, places in the memory, limits."""
    found: dict[str, tuple[list[int], list[int], list[Any]]] = {}
    for place, (type_, reference, low, high) in enumerate(variables, first):
        references, places, limits = found.setdefault(type_, ([], [], []))
        references.append(reference)
        places.append(place)
        limits.append((type_, low, high))
    return [(type_, *one) for type_, one in found.items()]


def _fitting(value: float, type_: str, low: float, high: float) -> float:
    """As its variable can have it: what is beyond its limits is at them."""
    if type_ == "Boolean":
        return value != 0.0
    if math.isnan(value):
        value = 0.0
    if value <= low:
        return low
    if value >= high:
        return high
    return value if type_ in {"Real", "Float32", "Float64"} else round(value)
