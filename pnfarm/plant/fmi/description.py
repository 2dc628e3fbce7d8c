"""Reads the modelDescription.xml of an FMU that is not trusted: FMI 2.0.5, clause 2.2; FMI 3.0.2, clause 2.4."""

from __future__ import annotations

import math
import re
import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from pnfarm.vocabulary.quoting import shown
from pnfarm.vocabulary.untrusted_xml import read_xml

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["MAX_OCTETS", "FmuDescription", "FmuFileError", "FmuVariable", "read_description"]

#: Largest description, octets.
MAX_OCTETS = 64 << 20
MAX_DEPTH = 32
#: Most variables that are kept: inputs, outputs, parameters and what has a start value.
MAX_VARIABLES = 100_000
MAX_NAME, MAX_TEXT = 200, 200
_ALLOWED = "an FMU for co-simulation, FMI 2.0 or 3.0"
_VERSION = re.compile(r"(2)\.0|(3)\.[0-9]{1,3}(?:\.[0-9]{1,3})?")
_IDENTIFIER = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,199}")
#: A unit that a wire can have.
_UNIT = re.compile(r"[A-Za-z%°µμ][A-Za-z0-9%°µμ/^².]{0,15}")
#: Units that this farm writes otherwise.
_OWN_UNITS = {"N.m": "Nm", "N*m": "Nm", "rev": "revolutions", "rev/min": "rpm", "r/min": "rpm"}
_DOUBLE, _SINGLE = sys.float_info.max, 3.4028234663852886e38
_WHOLE: dict[str, tuple[float, float]] = {
    f"{sign}Int{bits}": (0, (1 << bits) - 1) if sign else (-(1 << bits - 1), (1 << bits - 1) - 1)
    for sign in ("", "U")
    for bits in (8, 16, 32, 64)
}
#: By version and element: the type in the names of FMI's functions, and the values that it can have.
_TYPES: dict[int, dict[str, tuple[str, float, float]]] = {
    2: {
        "Real": ("Real", -_DOUBLE, _DOUBLE),
        "Integer": ("Integer", *_WHOLE["Int32"]),
        "Enumeration": ("Integer", *_WHOLE["Int32"]),
        "Boolean": ("Boolean", 0, 1),
        "String": ("String", 0, 0),
    },
    3: {
        "Float64": ("Float64", -_DOUBLE, _DOUBLE),
        "Float32": ("Float32", -_SINGLE, _SINGLE),
        **{name: (name, *limits) for name, limits in _WHOLE.items()},
        "Enumeration": ("Int64", *_WHOLE["Int64"]),
        "Boolean": ("Boolean", 0, 1),
        "String": ("String", 0, 0),
        "Binary": ("Binary", 0, 0),
        "Clock": ("Clock", 0, 0),
    },
}
_FLOATS = frozenset({"Real", "Float32", "Float64"})
_NO_PORTS = frozenset({"String", "Binary", "Clock"})
_PORTS = frozenset({"input", "output"})


class FmuFileError(Exception):
    """What is wrong with an FMU, and what is allowed."""

    def __init__(self, what: str, allowed: str = _ALLOWED) -> None:
        super().__init__(what)
        self.allowed = allowed


@dataclass(frozen=True, slots=True)
class FmuVariable:
    """``type`` as in the names of FMI's functions; ``low``, ``high``: whole numbers, unless it is one of floats.

    ``no_port`` says why it cannot be a port.
    """

    name: str
    reference: int
    type: str
    causality: Literal["input", "output", "parameter", "other"]
    unit: str
    low: float
    high: float
    start: str
    doc: str
    is_settable: bool
    no_port: str

    @property
    def is_bit(self) -> bool:
        return self.type == "Boolean"

    @property
    def is_whole(self) -> bool:
        return not self.is_bit and self.type not in _FLOATS

    @property
    def has_limits(self) -> bool:
        """Whether not every number fits."""
        return self.low > -_DOUBLE or self.high < _DOUBLE

    @property
    def start_value(self) -> float:
        """The start value of one that is a port; 0 without, or where it is none."""
        try:
            value = float({"true": "1", "false": "0"}.get(self.start.strip(), self.start))
        except ValueError:
            return 0.0
        return value if math.isfinite(value) else 0.0


@dataclass(frozen=True, slots=True)
class FmuDescription:
    """``version``: 2 or 3; ``identifier``: the name of its library; ``token``: guid or instantiationToken.

    ``variables`` by name: inputs, outputs, and what a start value may be given to.
    """

    version: int
    name: str
    identifier: str
    token: str
    varies_steps: bool
    saves_state: bool
    variables: Mapping[str, FmuVariable] = field(default_factory=dict)

    def of(self, causality: str) -> list[FmuVariable]:
        """Those that can be ports, in the file's order."""
        return [one for one in self.variables.values() if one.causality == causality and not one.no_port]


def read_description(data: bytes) -> FmuDescription:
    """Raises :class:`FmuFileError`."""
    if len(data) > MAX_OCTETS:
        raise FmuFileError(f"its modelDescription.xml has more than {MAX_OCTETS} octets")
    reader = _Reader()
    read_xml(data, start=reader.start, end=reader.end, characters=lambda _: None, refused=_XmlError)
    return reader.found()


class _XmlError(FmuFileError):
    def __init__(self, what: str) -> None:
        super().__init__(f"its modelDescription.xml is refused: {what}")


class _Reader:
    def __init__(self) -> None:
        self._path: list[str] = []
        self._version = 0
        self._root: dict[str, str] = {}
        self._simulation: dict[str, str] | None = None
        self._exchanges = False
        #: Attributes of types by the types' names.
        self._types: dict[str, dict[str, str]] = {}
        self._type = ""
        #: Element and attributes of each variable that is kept, by name.
        self._variables: dict[str, tuple[str, dict[str, str]]] = {}
        self._arrays: set[str] = set()
        self._variable: dict[str, str] | None = None

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        self._path.append(tag)
        if len(self._path) > MAX_DEPTH:
            raise _XmlError(f"its elements are nested deeper than {MAX_DEPTH}")
        match self._path[1:]:
            case []:
                self._begin(tag, attributes)
            case ["CoSimulation"]:
                self._simulation = attributes
            case ["ModelExchange"]:
                self._exchanges = True
            case ["TypeDefinitions", _]:
                self._type = attributes.get("name", "")
                self._types[self._type] = attributes
            case ["TypeDefinitions", "SimpleType", _]:
                self._types[self._type] = self._types[self._type] | attributes
            case ["ModelVariables", element]:
                self._variable = attributes
                if self._version == 3:
                    self._keep(element, attributes)
            case ["ModelVariables", "ScalarVariable", element] if self._variable is not None and self._version == 2:
                # each has one element of its type; it has Annotations, too
                if element in _TYPES[2]:
                    self._keep(element, attributes | self._variable)
            case ["ModelVariables", _, "Dimension"] if self._variable is not None:
                self._arrays.add(self._variable.get("name", ""))

    def end(self, _tag: str) -> None:
        """An element ends."""
        self._path.pop()

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        if tag != "fmiModelDescription":
            raise _XmlError(f"its root is {shown(tag)}, not 'fmiModelDescription'")
        text = attributes.get("fmiVersion", "")
        found = _VERSION.fullmatch(text)
        if found is None:
            raise FmuFileError(f"it is an FMU of FMI {text[:MAX_TEXT] or 'without version'}")
        self._version = int(found[1] or found[2])
        self._root = attributes

    def _keep(self, element: str, attributes: dict[str, str]) -> None:
        causality = attributes.get("causality", "local")
        if element not in _TYPES[self._version] or not (
            causality in _PORTS or causality.lower().endswith("parameter") or attributes.get("initial") == "exact"
        ):
            return
        name = attributes.get("name", "")
        if len(self._variables) >= MAX_VARIABLES:
            raise FmuFileError(f"it has more than {MAX_VARIABLES} inputs, outputs and parameters")
        if not name or name in self._variables:
            raise _XmlError(f"variable {shown(name)} appears twice" if name else "a variable has no name")
        self._variables[name] = (element, attributes)

    def found(self) -> FmuDescription:
        if self._simulation is None:
            kind = "model exchange only" if self._exchanges else "neither co-simulation nor model exchange"
            raise FmuFileError(f"it is an FMU for {kind}")
        identifier = self._simulation.get("modelIdentifier", "")
        if not _IDENTIFIER.fullmatch(identifier):
            raise _XmlError(f"its modelIdentifier is {shown(identifier)}")
        simulation = {key.lower(): value.strip() in {"true", "1"} for key, value in self._simulation.items()}
        return FmuDescription(
            self._version,
            self._root.get("modelName", identifier)[:MAX_TEXT],
            identifier,
            self._root.get("guid" if self._version == 2 else "instantiationToken", ""),
            simulation.get("canhandlevariablecommunicationstepsize", False),
            simulation.get("cangetandsetfmustate", False) and simulation.get("canserializefmustate", False),
            {name: self._made(name, *one) for name, one in self._variables.items()},
        )

    def _made(self, name: str, element: str, own: dict[str, str]) -> FmuVariable:
        attributes = self._types.get(own.get("declaredType", ""), {}) | own
        kind, low, high = _TYPES[self._version][element]
        causality = attributes.get("causality", "local")
        initial = attributes.get("initial", "exact" if causality == "parameter" else "")
        reference = _number(name, attributes, "valueReference", -1)
        if not (0 <= reference < 1 << 32 and reference == int(reference)):
            raise _XmlError(f"variable {shown(name)} has no valueReference")
        low = max(low, _number(name, attributes, "min", low))
        high = min(high, _number(name, attributes, "max", high))
        is_whole = kind not in _FLOATS | _NO_PORTS
        if low > high or (is_whole and math.ceil(low) > math.floor(high)):
            raise _XmlError(f"the limits of variable {shown(name)} leave no value")
        if is_whole:
            low, high = math.ceil(low), math.floor(high)
        no_port = f"is of type {element}" if kind in _NO_PORTS else "is an array" if name in self._arrays else ""
        if len(name) > MAX_NAME:
            no_port = f"has a name longer than {MAX_NAME} characters"
        return FmuVariable(
            name,
            int(reference),
            kind,
            causality if causality in {"input", "output", "parameter"} else "other",  # type: ignore[arg-type]
            _unit(attributes.get("unit", "")),
            low,
            high,
            attributes.get("start", "")[:MAX_TEXT],
            " ".join(attributes.get("description", "").split())[:MAX_TEXT],
            causality in {"parameter", "output", "local"}
            and initial == "exact"
            and attributes.get("variability") != "constant"
            and (kind == "String" or not no_port)
            and name not in self._arrays,
            no_port,
        )


def _number(name: str, attributes: Mapping[str, str], key: str, default: float) -> float:
    text = attributes.get(key)
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise _XmlError(f"{key} of variable {shown(name)} is {shown(text)}")
    return value


def _unit(text: str) -> str:
    """As a wire has it; what no wire can have is no unit."""
    text = _OWN_UNITS.get(text, text)
    return text if _UNIT.fullmatch(text) else ""
