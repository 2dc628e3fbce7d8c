"""Kinds of injections: texts, parameters, accepted common fields, effect. Each kind has its own file,

those of any drive in :mod:`pnfarm.faults.kinds`, those of a bus with the bus.
Such a file has the effect, if it is not another kind's, and ``KIND``; one with several kinds has ``KINDS``.

Common fields, as far as a kind takes them: ``probability`` (of each occurrence) with ``seed``; ``direction``, seen from
the drive; a start ``when`` a condition holds, ``after`` a time or ``after_cycles`` healthy cycles of the connection; an
end after ``count`` occurrences, ``for`` a time or ``cycles`` of the connection.  Every kind takes ``share`` and
``most``, which choose some of the matching drives by the seed, ``ttl``, after which it ends unless it is renewed, and
where it can begin again ``rate`` and ``times``: at random, exponentially distributed, so often.  Each kind defines what
an occurrence is.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from pnfarm.errors import InternalError
from pnfarm.vocabulary.durations import format_duration, read_duration
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown
from pnfarm.vocabulary.samples import SAMPLES, read_samples
from pnfarm.wire.mac import NIL, is_group, parse_mac

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from pnfarm.faults.effects.effect import Effect
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.wire.direction import Directions

__all__ = [
    "EACH",
    "EVERY_DIRECTION",
    "FRAMES",
    "HELD",
    "OCTET",
    "WORD",
    "InjectionKind",
    "KindOnBus",
    "Misfits",
    "ParamSpec",
    "by_values",
    "words_of",
]

ParamType = Literal[
    "whole number", "number", "yes or no", "duration", "word", "fault", "octets", "mac", "text", "samples"
]

#: Fields that contradict each other, with what is wrong.
Misfits: TypeAlias = "Iterable[tuple[str, Problem]]"

#: Common fields of kinds that act on frames, on one occurrence after the other, or that last until they end.
FRAMES = frozenset({"probability", "seed", "count", "for", "cycles"})
EACH = frozenset({"probability", "seed", "count", "for"})
HELD = frozenset({"for", "cycles"})
EVERY_DIRECTION: tuple[Directions, ...] = ("both", "in", "out")

#: Ranges of parameters.
OCTET: dict[str, Any] = {"low": 0, "high": 0xFF}
WORD: dict[str, Any] = {"low": 0, "high": 0xFFFF}
#: Characters of a text in place of a number.
_LONGEST_NAME = 200


@dataclass(frozen=True, slots=True)
class ParamSpec:
    """One parameter of a kind.  ``words`` are names for numbers, or the only words of a ``word``.

    Durations are given as ``500ms`` and read as nanoseconds.  ``high`` of octets is how many there may be.
    ``required`` ones have no default.  ``other`` says what a text is, or by what text a number may be given; the effect
    reads it.
    """

    type: ParamType
    doc: str
    default: Any = None
    required: bool = False
    unit: str = ""
    low: float | None = None
    high: float | None = None
    words: Mapping[str, int] = field(default_factory=dict)
    other: str = ""

    @property
    def allowed(self) -> str:
        """What a user may write, for messages."""
        match self.type:
            case "yes or no":
                return "true or false"
            case "duration":
                low = "" if not self.low else f" from {format_duration(int(self.low))}"
                high = "" if self.high is None else f"{'' if low else ' up'} to {format_duration(int(self.high))}"
                return f"a duration{low}{high}{',' if low or high else ''} such as 500ms or 2s"
            case "word":
                return ", ".join(self.words)
            case "mac":
                return "the MAC address of one station, such as 02:00:5e:00:00:01"
            case "octets":
                most = "" if self.high is None else f", at most {self.high:g} octets"
                return f"octets in hexadecimal, such as 0a1bff or hex:0102{most}"
            case "text":
                return self.other
            case "samples":
                return SAMPLES
            case "fault":
                return "a number, name or cause of the drive's model, such as 702 or undervoltage"
            case _:
                form = ".0f" if self.type == "whole number" else "g"
                bounded = self.low is not None and self.high is not None
                bounds = f" from {self.low:{form}} to {self.high:{form}}" if bounded else ""
                named = f", or one of {', '.join(self.words)}" if self.words else ""
                other = f", or {self.other}" if self.other else ""
                return f"a {self.type}{bounds}{named}{other}"

    def read(self, value: Any) -> Any:
        """The value as the kind uses it; raises :class:`Problem`."""
        match self.type:
            case "yes or no":
                if not isinstance(value, bool):
                    raise Problem(f"is {shown(value)}", self.allowed)
                return value
            case "duration":
                duration = read_duration(value)
                if duration < (self.low or 0) or (self.high is not None and duration > self.high):
                    raise Problem(f"is {shown(value)}", self.allowed)
                return duration
            case "word":
                if value not in self.words:
                    hint = did_you_mean(value, self.words) if isinstance(value, str) else ""
                    raise Problem(f"is {shown(value)}{hint}", self.allowed)
                return value
            case "octets":
                return self._octets(value)
            case "mac":
                return self._mac(value)
            case "text":
                return self._text(value)
            case "samples":
                read_samples(value)
                return value
            case "fault":
                if isinstance(value, bool) or not isinstance(value, (int, str)) or value == "":
                    raise Problem(f"is {shown(value)}", self.allowed)
                return value
            case _:
                return self._number(value)

    def _mac(self, value: Any) -> bytes:
        try:
            mac = parse_mac(value) if isinstance(value, str) else b""
        except ValueError as exc:
            raise Problem(f"is {shown(value)}", self.allowed) from exc
        if mac in {b"", NIL} or is_group(mac):
            raise Problem(f"is {shown(value)}", self.allowed)
        return mac

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

    def _text(self, value: Any) -> str:
        # a command line or a YAML file gives what looks like one as a number or a switch
        text = str(value).lower() if isinstance(value, bool) else str(value)
        if not isinstance(value, bool | int | float | str) or not text.strip() or len(text) > _LONGEST_NAME:
            raise Problem(f"is {shown(value)}", self.allowed)
        return text.strip()

    def _number(self, value: Any) -> int | float | str:
        if isinstance(value, str):
            word = value.strip().lower()
            if word in self.words:
                return self.words[word]
            try:
                value = int(word, 0) if self.type == "whole number" else float(word)
            except ValueError as exc:
                if self.other and word and len(word) <= _LONGEST_NAME:
                    return str(value).strip()
                raise Problem(f"is {shown(value)}{did_you_mean(word, self.words)}", self.allowed) from exc
        wanted = int if self.type == "whole number" else (int, float)
        if isinstance(value, bool) or not isinstance(value, wanted):
            raise Problem(f"is {shown(value)}", self.allowed)
        low = float("-inf") if self.low is None else self.low
        high = float("inf") if self.high is None else self.high
        # written so that NaN fails as well
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
class KindOnBus:
    """What a kind is on drives of one bus: further parameters, what is on its wire and what its controllers report.

    Empty texts: as for any bus.  ``refused`` says why drives on this bus have no such thing.  ``title`` is the bus's.
    """

    title: str
    params: Mapping[str, ParamSpec] = field(default_factory=dict)
    wire: str = ""
    reports: str = ""
    refused: str = ""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"params": list(self.params), "wire": self.wire, "reports": self.reports, "refused": self.refused}


def by_values(check: Callable[[dict[str, Any]], Misfits]) -> Callable[[InjectionFields], Misfits]:
    """A kind's ``misfits`` that looks at the values of the parameters, where each is right by itself."""

    def misfits(spec: InjectionFields) -> Misfits:
        try:
            values = spec.values()
        except Problem:
            # the parameter's own error is already reported
            return ()
        return check(values)

    return misfits


@dataclass(frozen=True, slots=True, eq=False)
class InjectionKind:
    """One kind.  ``effect`` carries it out on one drive; it gets the ``preset`` parameters with the given ones.

    ``directions`` is empty for a kind that has none; its first entry is the default.  ``takes`` are the common
    fields that it accepts, besides ``after`` and ``after_cycles``, which all take.  ``misfits`` reports
    fields that exclude each other. ``wire`` is what a capture shows, ``reports`` what controllers report; what is
    inferred there is marked "(assumed)".  ``place`` is its position in the list of its family; kinds with the same
    place are sorted by name.  ``on`` has what differs on a bus, by the bus's name.
    """

    name: str
    family: str
    doc: str
    occurrence: str
    effect: type[Effect]
    params: Mapping[str, ParamSpec] = field(default_factory=dict)
    directions: tuple[Directions, ...] = ()
    takes: frozenset[str] = frozenset()
    preset: Mapping[str, Any] = field(default_factory=dict)
    wire: str = ""
    reports: str = ""
    misfits: Callable[[InjectionFields], Misfits] = lambda _: ()
    place: int = 1000
    on: Mapping[str, KindOnBus] = field(default_factory=dict)

    def joined(self, on: Mapping[str, KindOnBus]) -> InjectionKind:
        """The kind with what buses have to say about it, and with their parameters.

        Raises :class:`InternalError` for a parameter that appears twice.
        """
        params = dict(self.params)
        for one in on.values():
            for name, spec in one.params.items():
                if name in params:
                    raise InternalError(f"{self.name} has two parameters {name}")
                params[name] = spec
        return replace(self, params=params, on=dict(on))

    @property
    def common(self) -> tuple[str, ...]:
        """Fields that any kind has, and those of repetition where it can begin again."""
        repeats = self.effect.ends_by_itself or not self.takes.isdisjoint({"count", "for", "cycles"})
        return ("after", "after_cycles", "share", "most", "ttl", *(("rate", "times") if repeats else ()))

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the API's ``fault-kinds`` and ``pnfarm fault kinds --format json``."""
        return {
            "kind": self.name,
            "family": self.family,
            "doc": self.doc,
            "occurrence": self.occurrence,
            "wire": self.wire,
            "reports": self.reports,
            "buses": {bus: one.as_dict() for bus, one in self.on.items()},
            "params": {name: spec.as_dict() for name, spec in self.params.items()},
            "directions": list(self.directions),
            "takes": [*self.common, *sorted(self.takes)],
        }


def words_of(enum: Any) -> dict[str, int]:
    """The members of an enumeration as words of a parameter: ``module-failure``."""
    return {member.name.lower().replace("_", "-"): int(member) for member in enum}
