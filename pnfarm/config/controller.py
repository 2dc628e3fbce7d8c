"""The built-in controller: the keys that it has on any bus."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, PrivateAttr

from pnfarm.config.links import Link
from pnfarm.config.section import Section
from pnfarm.config.values import OFF, Duration, Interface, NamePattern, between
from pnfarm.table.program import TARGETS
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.vocabulary.issues import Location

__all__ = ["ControllerSection", "Program", "Reconnect"]


#: Of one call of a program of one's own.
LEAST_LIMIT_NS, MOST_LIMIT_NS = 1_000_000, 60_000_000_000
#: Time of one call in virtual time.
LEAST_CALL_NS, MOST_CALL_NS = 1_000, 1_000_000_000


class Program(Section):
    """What the axis program does with each drive."""

    kind: Literal["constant", "ramp", "sine", "positions", "idle"] = Field(
        default="idle",
        description="Kind of motion; positions moves from target to target in position mode; idle exchanges "
        "data and leaves the drive disabled.",
    )
    speed_rpm: float = Field(
        default=100.0,
        ge=-100_000,
        le=100_000,
        description="Speed, its peak, or the velocity of a move, rpm (linear motor: pitches a minute).",
    )
    targets: list[Annotated[float, Field(ge=-10_000, le=10_000)]] = Field(
        default=[0.0, 1.0],
        min_length=1,
        max_length=TARGETS,
        description="Targets of positions, in turn, revolutions (linear motor: pitches) from the home position.",
    )
    acceleration: float = Field(
        default=10_000.0, gt=0, le=10_000_000, description="Acceleration and deceleration of positions, rpm/s."
    )
    dwell_ns: Duration = Field(default=0, alias="dwell", description="Pause of positions at each target.")
    period_ns: Duration = Field(default=2_000_000_000, alias="period", description="Period of one ramp or sine.")
    enable: bool = Field(default=True, description="Whether it enables the drive (S4, operation).")
    acknowledge_after_ns: Duration | None = Field(
        default=None, alias="acknowledge_after", description="Acknowledge a fault after this time; left out, never."
    )
    python: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="A program of your own, a Python file relative to this one (docs/plc-programs.md), instead of "
        "`kind`.",
    )
    class_name: Annotated[str, Field(min_length=1)] | None = Field(
        default=None, alias="class", description="Its class; left out if the file has only one."
    )
    limit_ns: Annotated[Duration, between(LEAST_LIMIT_NS, MOST_LIMIT_NS, "1ms to 60s")] = Field(
        default=1_000_000_000,
        alias="limit",
        description="Longest duration of one call of that program; its axis is stopped after it.",
    )

    call_time_ns: Annotated[Duration, between(LEAST_CALL_NS, MOST_CALL_NS, "0ns, or 1us to 1s", zero=True)] = Field(
        default=0,
        alias="call_time",
        description="In virtual time, where code takes no time: how long a call of that program takes.  The "
        "axes that exchange data share one processor; when they need more than a cycle, the next one is missed.",
    )

    @property
    def beside_python(self) -> list[str]:
        """Keys that were given and that a program of one's own does not have."""
        own = {"python", "class_name", "limit_ns", "call_time_ns"}
        wrong = self.model_fields_set - own if self.python is not None else self.model_fields_set & own
        return [field.alias or name for name, field in type(self).model_fields.items() if name in wrong]


class Reconnect(Section):
    """What follows a lost connection."""

    after_ns: Duration = Field(default=1_000_000_000, alias="after", description="Pause before the next Connect.")


def _open_reconnect(value: Any) -> Any:
    if value is False or value == OFF:
        return None
    if isinstance(value, (dict, Reconnect)):
        return value
    raise Problem(f"is {shown(value)}", "off, or a mapping such as {after: 1s}")


class ControllerSection(Section):
    """Keys of the controller on any bus; a bus's section adds its own.

    A file with drives on several buses has one for each: the keys of the section, and those of the map for that bus.
    """

    #: What all controllers of a file share, below a key: there is one program of one's own, and it sees all axes.
    shared_keys: ClassVar[Mapping[str, frozenset[str]]] = {
        "program": frozenset({"python", "class", "limit", "call_time"})
    }
    #: Keys of one bus only: a device has one description, on one bus.
    single_keys: ClassVar[frozenset[str]] = frozenset({"devices"})
    #: The kind of file by which a maker describes a device of this bus.
    description_file: ClassVar[str] = ""

    name: NamePattern = Field(default="plc", description="Its station name.")
    interface: Interface | None = Field(default=None, description="Existing interface to use; it is not changed.")
    link: Link | None = Field(default=None, description="Link of the controller; left out, the farm's.")
    program: Program = Field(default_factory=Program)
    reconnect: Annotated[Reconnect | None, BeforeValidator(_open_reconnect)] = Field(
        default_factory=Reconnect, description="`off`: stay disconnected."
    )

    _map: str = PrivateAttr(default="")
    _in_map: frozenset[str] = PrivateAttr(default=frozenset())

    def placed(self, bus: str, keys: Iterable[str]) -> Self:
        """Remember which keys are from the map of a bus; the last step of reading."""
        self._map, self._in_map = bus, frozenset(keys)
        return self

    def at(self, *keys: str | int) -> Location:
        """Where the file has a key of this controller: in the section, or in the map for its bus."""
        inside = bool(keys) and keys[0] in self._in_map
        return ("controller", self._map, *keys) if inside else ("controller", *keys)

    @property
    def device_names(self) -> Sequence[str]:
        """Devices besides the drives of the file, which no model describes: a bus's key `devices`."""
        return [device.name for device in getattr(self, "devices", ())]
