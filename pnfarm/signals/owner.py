"""Whatever has signals with names: devices, and models of the plant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from pnfarm.station.plain_signals import NamedSignals

__all__ = ["SignalOwner"]


class _Connected(Protocol):
    @property
    def connected(self) -> bool: ...


class SignalOwner(Protocol):
    """A station (:class:`pnfarm.station.station.Station`), or a model of the plant."""

    @property
    def configured_name(self) -> str:
        """The name in the farm file."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """What globs find it by beside its name."""

    @property
    def signals(self) -> NamedSignals | None:
        """None where it has none."""

    @property
    def powered(self) -> bool: ...

    @property
    def device(self) -> _Connected: ...
