"""One parameter as data, and the errors of its access.

The error numbers are those of the PROFIdrive base mode parameter access (Moog MSD manual, table 9.7; profile 4.1,
chapter 6.2.3); every other access to a parameter (API, command line) reports the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

from pnfarm.errors import PnfarmError

__all__ = [
    "FLOAT_HIGHEST",
    "Backing",
    "Form",
    "Parameter",
    "ParameterError",
    "ParameterErrorNumber",
    "ParameterType",
    "refusal",
]


class ParameterErrorNumber(IntEnum):
    """Why an access was refused."""

    IMPERMISSIBLE_PNU = 0x00
    NOT_CHANGEABLE = 0x01
    LIMIT_EXCEEDED = 0x02
    FAULTY_SUBINDEX = 0x03
    NO_ARRAY = 0x04
    INCORRECT_DATA_TYPE = 0x05
    ONLY_RESET = 0x06
    DESCRIPTION_NOT_CHANGEABLE = 0x07
    NO_DESCRIPTION = 0x09
    NO_OPERATION_PRIORITY = 0x0B
    NO_TEXT_ARRAY = 0x0F
    OPERATING_STATE = 0x11
    VALUE_IMPERMISSIBLE = 0x14
    RESPONSE_TOO_LONG = 0x15
    ADDRESS_IMPERMISSIBLE = 0x16
    ILLEGAL_FORMAT = 0x17
    NUMBER_OF_VALUES = 0x18
    AXIS_NONEXISTENT = 0x19
    TEXT_NOT_CHANGEABLE = 0x20
    SERVICE_NOT_SUPPORTED = 0x21
    TOO_MANY_PARAMETERS = 0x22
    MULTI_PARAMETER = 0x23

    @property
    def words(self) -> str:
        """The profile's wording."""
        return _WORDS[self]

    @property
    def tells_subindex(self) -> bool:
        """Whether the response carries the subindex as a second value (profile 4.1: additional information)."""
        return self in _WITH_SUBINDEX


#: Exponent bits of a float32; all are set in infinities and NaN.
FLOAT_EXPONENT = 0x7F800000
FLOAT_HIGHEST = 0xFF7FFFFF
_WORDS = {
    ParameterErrorNumber.IMPERMISSIBLE_PNU: "impermissible parameter number",
    ParameterErrorNumber.NOT_CHANGEABLE: "parameter value cannot be changed",
    ParameterErrorNumber.LIMIT_EXCEEDED: "low or high limit exceeded",
    ParameterErrorNumber.FAULTY_SUBINDEX: "faulty subindex",
    ParameterErrorNumber.NO_ARRAY: "no array",
    ParameterErrorNumber.INCORRECT_DATA_TYPE: "incorrect data type",
    ParameterErrorNumber.ONLY_RESET: "setting not permitted, may only be reset",
    ParameterErrorNumber.DESCRIPTION_NOT_CHANGEABLE: "description element cannot be changed",
    ParameterErrorNumber.NO_DESCRIPTION: "no description data available",
    ParameterErrorNumber.NO_OPERATION_PRIORITY: "no operation priority",
    ParameterErrorNumber.NO_TEXT_ARRAY: "no text array available",
    ParameterErrorNumber.OPERATING_STATE: "request cannot be executed because of the operating state",
    ParameterErrorNumber.VALUE_IMPERMISSIBLE: "value impermissible",
    ParameterErrorNumber.RESPONSE_TOO_LONG: "response too long",
    ParameterErrorNumber.ADDRESS_IMPERMISSIBLE: "parameter address impermissible",
    ParameterErrorNumber.ILLEGAL_FORMAT: "illegal format",
    ParameterErrorNumber.NUMBER_OF_VALUES: "number of values inconsistent",
    ParameterErrorNumber.AXIS_NONEXISTENT: "axis or drive object nonexistent",
    ParameterErrorNumber.TEXT_NOT_CHANGEABLE: "parameter text element cannot be changed",
    ParameterErrorNumber.SERVICE_NOT_SUPPORTED: "service not supported",
    ParameterErrorNumber.TOO_MANY_PARAMETERS: "too many parameters in a request",
    ParameterErrorNumber.MULTI_PARAMETER: "multi parameter access not supported",
}
_WITH_SUBINDEX = {
    ParameterErrorNumber.NOT_CHANGEABLE,
    ParameterErrorNumber.LIMIT_EXCEEDED,
    ParameterErrorNumber.FAULTY_SUBINDEX,
    ParameterErrorNumber.ONLY_RESET,
    ParameterErrorNumber.DESCRIPTION_NOT_CHANGEABLE,
    ParameterErrorNumber.VALUE_IMPERMISSIBLE,
    ParameterErrorNumber.TEXT_NOT_CHANGEABLE,
}


class ParameterError(PnfarmError):
    """An access was refused: ``number`` says why (a peer may send any), ``value`` the offending subindex or value."""

    exit_code = 2

    def __init__(self, number: int, value: int | None = None, detail: str = "") -> None:
        try:
            words = ParameterErrorNumber(number).words
        except ValueError:
            words = "manufacturer specific"
        super().__init__(f"{detail}: {words} (0x{number:02X})" if detail else f"{words} (0x{number:02X})")
        self.number = int(number)
        self.value = value


class ParameterType(IntEnum):
    """Data types of a model's table; the value is the width in octets, ``COMMAND`` is sent as a byte."""

    COMMAND = 0
    BYTE = 1
    WORD = 2
    DWORD = 4
    QWORD = 8

    @property
    def octets(self) -> int:
        return self.value or 1


class Form(Enum):
    """The meaning of a value's bits that are not an integer."""

    INTEGER = "integer"
    FLOAT = "float"  # a double word: IEEE 754, single precision
    TEXT = "text"  # octets: one character each, an array as long as the text may be


class Backing(IntEnum):
    """What a parameter reads or writes."""

    STORED = 0  # a value of the drive's own store
    ALIAS = 1  # another parameter under a second number
    FIELD = 2  # a field of the axis record
    SIGNAL = 3  # a slot of the process image
    COMMAND = 4  # writing acts
    COMPUTED = 5  # a function of the drive


@dataclass(frozen=True, slots=True)
class Parameter:
    """One row of a model's ``parameters.csv``.

    ``minimum``, ``maximum`` and ``default`` are raw numbers as on the wire; ``standardisation`` times the raw number is
    the value in ``unit``, ``factor`` (or the named ``scale``) times it what a field of the axis becomes.  ``source`` is
    where number, name and type stand, ``values_source`` where access, limits, default and meaning do; ``elements`` is 0
    unless the parameter is an array.  One with ``after_power_on`` is written at once and takes effect with the next
    power cycle.
    """

    pnu: int
    name: str
    type: ParameterType
    signed: bool
    elements: int
    readable: bool
    writable: bool
    minimum: int
    maximum: int
    default: int
    unit: str
    scale: str
    factor: float
    backing: Backing
    argument: str
    index: int
    nonvolatile: bool
    source: str
    values_source: str
    note: str
    after_power_on: bool = False
    #: Every element's default, for an array that is stored or in the axis record.
    defaults: tuple[int, ...] = ()
    #: With the scale ``a|b|...``: the values of the raw numbers 0, 1, ...
    choices: tuple[float, ...] = ()
    #: The only values that it accepts; empty for all within its limits.
    only: frozenset[int] = frozenset()
    #: The kind of motor that it is for, ``rotary`` or ``linear``; empty for all.  With another kind it has no effect.
    motor: str = ""
    form: Form = Form.INTEGER
    standardisation: float = 1.0

    @property
    def text(self) -> bool:
        """Whether its elements are the characters of a text."""
        return self.form is Form.TEXT

    @property
    def only_reset(self) -> bool:
        """Whether zero is the only value that can be written."""
        counts = self.backing is Backing.COMPUTED and self.argument in {"fault-situations", "kept-situations"}
        return counts and self.writable

    @property
    def octets(self) -> int:
        """Width of one value on the wire."""
        return self.type.octets

    def is_for(self, *, linear: bool) -> bool:
        """Whether it has an effect with a linear motor, or with a rotary one."""
        return not self.motor or (self.motor == "linear") == linear

    @property
    def lowest(self) -> int:
        """Smallest number that the type holds."""
        return -(1 << (8 * self.octets - 1)) if self.signed else 0

    @property
    def highest(self) -> int:
        """Largest number that the type holds; of a float the largest bits that are a finite number."""
        if self.form is Form.FLOAT:
            return FLOAT_HIGHEST
        return (1 << (8 * self.octets - (1 if self.signed else 0))) - 1

    def allows(self, value: int) -> bool:
        """Whether it accepts ``value``: within its limits, and finite if it is a float."""
        if self.form is Form.FLOAT and value & FLOAT_EXPONENT == FLOAT_EXPONENT:
            return False
        return self.minimum <= value <= self.maximum and (not self.only or value in self.only)

    def wrap(self, value: int) -> int:
        """``value`` cut to the type's bits."""
        bits = 8 * self.octets
        value &= (1 << bits) - 1
        return value - (1 << bits) if self.signed and value >> (bits - 1) else value

    def clamp(self, value: int) -> int:
        """``value`` limited to the type's range."""
        return min(max(value, self.lowest), self.highest)


def refusal(number: ParameterErrorNumber, parameter: Parameter, value: int | None = None) -> ParameterError:
    """The error of an access to ``parameter``, which it names; ``value`` is the offending subindex or value."""
    return ParameterError(number, value, f"{parameter.pnu} {parameter.name}")
