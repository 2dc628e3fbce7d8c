"""What a kind of fault is, as data: its words, its parameters, the common fields that it takes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from pnfarm.faults.words import Problem, did_you_mean, read_duration, shown

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["FaultKind", "ParamSpec", "Way", "words_of"]

ParamType = Literal["whole number", "number", "yes or no", "duration", "word", "fault", "octets"]
Way = Literal["in", "out", "both"]


@dataclass(frozen=True, slots=True)
class ParamSpec:
    """One parameter of a kind.  ``words`` are names for numbers, or the only words of a ``word``.

    Durations are given as ``500ms`` and read as nanoseconds.  ``high`` of octets is how many there may be.
    ``required`` ones have no default.
    """

    type: ParamType
    doc: str
    default: Any = None
    required: bool = False
    unit: str = ""
    low: float | None = None
    high: float | None = None
    words: Mapping[str, int] = field(default_factory=dict)

    @property
    def allowed(self) -> str:
        """What a user may write, in words."""
        match self.type:
            case "yes or no":
                return "true or false"
            case "duration":
                return "a duration such as 500ms or 2s"
            case "word":
                return ", ".join(self.words)
            case "octets":
                most = "" if self.high is None else f", at most {self.high:g} octets"
                return f"octets in hexadecimal, such as 0a1bff or hex:0102{most}"
            case "fault":
                return "a number, name or cause of the drive's model, such as 702 or undervoltage"
            case _:
                form = ".0f" if self.type == "whole number" else "g"
                bounded = self.low is not None and self.high is not None
                bounds = f" from {self.low:{form}} to {self.high:{form}}" if bounded else ""
                named = f", or one of {', '.join(self.words)}" if self.words else ""
                return f"a {self.type}{bounds}{named}"

    def read(self, value: Any) -> Any:
        """The value as the kind uses it; raises :class:`Problem`."""
        match self.type:
            case "yes or no":
                if not isinstance(value, bool):
                    raise Problem(f"is {shown(value)}", self.allowed)
                return value
            case "duration":
                return read_duration(value)
            case "word":
                if value not in self.words:
                    hint = did_you_mean(value, self.words) if isinstance(value, str) else ""
                    raise Problem(f"is {shown(value)}{hint}", self.allowed)
                return value
            case "octets":
                return self._octets(value)
            case "fault":
                if isinstance(value, bool) or not isinstance(value, (int, str)) or value == "":
                    raise Problem(f"is {shown(value)}", self.allowed)
                return value
            case _:
                return self._number(value)

    def _octets(self, value: Any) -> bytes:
        # digits alone come as a number from a command line or a YAML file, which loses leading zeros
        if not isinstance(value, str):
            raise Problem(f"is {shown(value)}", self.allowed)
        try:
            octets = bytes.fromhex(value.removeprefix("hex:"))
        except ValueError as exc:
            raise Problem(f"is {shown(value)}", self.allowed) from exc
        if self.high is not None and len(octets) > self.high:
            raise Problem(f"has {len(octets)} octets", self.allowed)
        return octets

    def _number(self, value: Any) -> int | float:
        if isinstance(value, str):
            word = value.strip().lower()
            if word in self.words:
                return self.words[word]
            try:
                value = int(word, 0) if self.type == "whole number" else float(word)
            except ValueError as exc:
                raise Problem(f"is {shown(value)}{did_you_mean(word, self.words)}", self.allowed) from exc
        wanted = int if self.type == "whole number" else (int, float)
        if isinstance(value, bool) or not isinstance(value, wanted):
            raise Problem(f"is {shown(value)}", self.allowed)
        low = float("-inf") if self.low is None else self.low
        high = float("inf") if self.high is None else self.high
        # written so that "not a number" fails as well
        if not low <= value <= high:
            raise Problem(f"is {shown(value)}", self.allowed)
        return value

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "type": self.type,
            "default": self.default,
            "required": self.required,
            "unit": self.unit,
            "minimum": self.low,
            "maximum": self.high,
            "words": list(self.words),
            "allowed": self.allowed,
            "doc": self.doc,
        }


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One kind.  ``effect`` names what it does (several kinds share one, with ``preset`` parameters).

    ``directions`` is empty for a kind that has none; its first entry is the default.  ``takes`` are the common
    fields that mean something for it, besides ``after`` and ``after_cycles``, which all take.
    """

    name: str
    family: str
    doc: str
    occurrence: str
    effect: str
    params: Mapping[str, ParamSpec] = field(default_factory=dict)
    directions: tuple[Way, ...] = ()
    takes: frozenset[str] = frozenset()
    preset: Mapping[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the API's ``fault-kinds`` and ``pnfarm fault kinds --format json``."""
        return {
            "kind": self.name,
            "family": self.family,
            "doc": self.doc,
            "occurrence": self.occurrence,
            "params": {name: spec.as_dict() for name, spec in self.params.items()},
            "directions": list(self.directions),
            "takes": ["after", "after_cycles", *sorted(self.takes)],
        }


def words_of(enum: Any) -> dict[str, int]:
    """The members of an enumeration as words of a parameter: ``module-failure``."""
    return {member.name.lower().replace("_", "-"): int(member) for member in enum}
