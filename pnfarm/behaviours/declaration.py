"""How a built-in behaviour of the plant is declared: its ports, its parameters, its equation and its step.

::

    LAMP = Behaviour(
        "lamp",
        "A lamp.",
        "lit = on",
        inputs=(bit("on", "the PLC's output"),),
        outputs=(bit("lit", "it is on"),),
        parameters=(duration("rise", "from on to lit", default=0.0),),
        state=1,
        step=step_lamp,
    )

The step is an inlined compiled function of ``values`` (the ports in sequence, inputs first; a bit is 0 or 1),
``memory`` (the parameters in sequence, then the state, which is 0 at the start) and ``seconds`` since the last step.
It allocates nothing, and it keeps every value finite where its inputs are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

__all__ = ["Behaviour", "Parameter", "Port", "bit", "choice", "duration", "number", "quantity"]


@dataclass(frozen=True, slots=True)
class Port:
    """An input or output of a model: ``bit`` or ``number``; without a unit a number takes any."""

    name: str
    form: Literal["bit", "number"]
    doc: str
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A key of the model in the farm file, in ``unit``; with ``words`` one of these, which are 0, 1 ... in memory.

    Without a default it must be given.
    """

    name: str
    doc: str
    unit: str = ""
    default: float | None = None
    low: float = -inf
    high: float = inf
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Behaviour:
    """See the module's docstring; ``equation`` is what its documentation shows."""

    name: str
    doc: str
    equation: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    parameters: tuple[Parameter, ...]
    state: int
    step: Callable[[Any, Any, float], None]
    #: Numbers of its state that count places of its memory, and the most of each.
    counts: Mapping[int, int] = field(default_factory=dict, hash=False)

    @property
    def port_lists(self) -> tuple[tuple[Port, ...], tuple[Port, ...]]:
        """Inputs, outputs."""
        return self.inputs, self.outputs

    @property
    def kind_name(self) -> str:
        return self.name

    @property
    def ports(self) -> tuple[Port, ...]:
        """In the order of their values."""
        return self.inputs + self.outputs


def bit(name: str, doc: str) -> Port:
    """A port that is 0 or 1."""
    return Port(name, "bit", doc)


def number(name: str, doc: str, unit: str = "") -> Port:
    """A port that is a number."""
    return Port(name, "number", doc, unit)


def quantity(
    name: str, doc: str, unit: str = "", default: float | None = None, *, low: float = -1e12, high: float = 1e12
) -> Parameter:
    """A parameter that is a number."""
    return Parameter(name, doc, unit, default, low, high)


def duration(name: str, doc: str, default: float | None = None) -> Parameter:
    """A parameter that is a time: up to a day, kept in seconds."""
    return Parameter(name, doc, "s", default, 0.0, 86_400.0)


def choice(name: str, doc: str, *words: str) -> Parameter:
    """A parameter that is one of these words, the first by default."""
    return Parameter(name, doc, default=0.0, words=words)
