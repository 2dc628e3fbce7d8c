"""An injection as a test holds it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.manager import Injection

__all__ = ["Fault"]


class Fault:
    """An injection in force: a context manager that ends it, with its evidence."""

    def __init__(self, injection: Injection, clear: Callable[[str], object]) -> None:
        self._injection = injection
        self._clear = clear

    @property
    def id(self) -> str:
        return self._injection.id

    @property
    def kind(self) -> str:
        return self._injection.spec.kind.name

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives that it is on."""
        return self._injection.drives

    @property
    def state(self) -> str:
        """``waiting``, ``active`` or ``ended``."""
        return self._injection.state.value

    @property
    def is_active(self) -> bool:
        return self.state == "active"

    @property
    def evidence(self) -> Evidence:
        """What happened so far: ``checks``, ``activations``, ``first_ns``, ``last_ns``, ``confirmed``."""
        return self._injection.evidence()

    def clear(self) -> None:
        """End it; does nothing if it has ended."""
        if self.state != "ended":
            self._clear(self.id)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.clear()

    def __repr__(self) -> str:
        return f"<Fault {self.id} {self.kind} on {', '.join(self.drives)}: {self.state}, {self.evidence}>"
