"""The signals of a station with plain data, as its station knows them (:mod:`pnfarm.signals.station_signals`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pnfarm.wire.value_types import Value

__all__ = ["NamedSignals", "PlainSignals"]


class NamedSignals(Protocol):
    """Named values of a device, or of a model of the plant; errors are :class:`pnfarm.errors.ConfigError`."""

    @property
    def names(self) -> tuple[str, ...]:
        """In the order of the file."""

    @property
    def revision(self) -> int:
        """Counts the changes that were seen."""

    def signal(self, name: str) -> Any:
        """One (:class:`pnfarm.signals.signal.Signal`) by its name."""

    def get(self, name: str) -> Value: ...

    def good(self, name: str) -> bool:
        """Whether the provider status of its data is GOOD."""

    def readings(self) -> Sequence[tuple[Any, Value, bool]]:
        """Every signal (:class:`pnfarm.signals.signal.Signal`) with its value and whether its data are good."""

    def set(self, values: Mapping[str, Value]) -> Mapping[str, str]:
        """Write inputs, all or none; those that a stronger owner has, and which."""

    def force(self, values: Mapping[str, Value | None]) -> Mapping[str, str]:
        """The same over what is written, until a None releases it; ``*`` releases all."""

    def owner(self, name: str) -> str:
        """Whose value it has: controller, fault, force, plant, value, default."""

    @property
    def forced(self) -> Mapping[str, Value]:
        """Forced inputs, and their values."""


class PlainSignals(NamedSignals, Protocol):
    """Those of a station: values of its data, of which the controller gets the inputs."""

    def whereabouts(self, name: str) -> tuple[int, int]:
        """Where the engine finds it: the row of plain data, and its first octet there."""

    def take(self, values: Mapping[str, Value]) -> None:
        """Values of the plant for inputs of the controller."""

    def state(self) -> Mapping[str, Any]:
        """What is written, hexadecimal, and forced."""

    def take_state(self, state: Mapping[str, Any], *, check: bool = False) -> None:
        """What :meth:`state` gave; ``check``: only look whether it fits."""

    @property
    def shaped(self) -> Sequence[str]:
        """The inputs that have a shape, once for each."""

    def put_shape(self, signal: Any, shape: Callable[[Value], Value]) -> None:
        """From now on the controller gets what this makes of an input."""

    def take_shape(self, signal: Any, shape: Callable[[Value], Value]) -> None:
        """Undo it."""

    def apply(self) -> None:
        """A shape changes its mind."""
