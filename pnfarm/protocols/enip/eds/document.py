"""What an electronic data sheet describes, as data: the device, its parameters, assemblies and connections."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError
from pnfarm.protocols.enip.connection import ConnectionKind
from pnfarm.protocols.enip.connection_check import ASSEMBLY
from pnfarm.protocols.enip.eds import bits
from pnfarm.vocabulary.problem import Problem
from pnfarm.vocabulary.quoting import did_you_mean, shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.protocols.enip.wire.epath import ElectronicKey
    from pnfarm.wire.value_types import Value, ValueType

__all__ = ["NO_DATA", "Assembly", "Connection", "Limits", "Member", "Parameter", "Sheet", "Way"]

# Bits of a parameter's descriptor (CIP volume 1, 5A-14.2): it is scaled; it is only read.
_SCALED, _READ_ONLY = 0x0004, 0x0010
#: Types whose bits have meanings of their own.
_BIT_STRINGS = frozenset({0xD1, 0xD2, 0xD3, 0xD4})
_BOOL = 0xC1


@dataclass(frozen=True, slots=True)
class Limits:
    """A number that the file fixes, or lets a user choose."""

    default: int
    least: int
    most: int


@dataclass(frozen=True, slots=True)
class Parameter:
    """``ParamN``; numbers are those on the wire.  ``enums`` names values, or the bits of a bit string.

    ``scaling``: multiplier, divisor, base and offset, whose value is (raw + offset) * multiplier * base / divisor.
    ``minimum`` and ``maximum`` are None where the file has none.
    """

    number: int
    name: str
    path: bytes
    descriptor: int
    code: int
    type: ValueType
    unit: str = ""
    help: str = ""
    minimum: int | float | None = None
    maximum: int | float | None = None
    default: Value = 0
    scaling: tuple[int, int, int, int] = (1, 1, 1, 0)
    decimals: int = 0
    enums: Mapping[int, str] = field(default_factory=dict)

    @property
    def read_only(self) -> bool:
        return bool(self.descriptor & _READ_ONLY)

    @property
    def is_bool(self) -> bool:
        return self.code == _BOOL

    @property
    def bit_names(self) -> Mapping[int, str]:
        return self.enums if self.code in _BIT_STRINGS else {}

    @property
    def scale(self) -> float:
        """Units of one step; 1 where the value is not scaled, or has an offset, which no signal has."""
        multiplier, divisor, base, offset = self.scaling
        if not self.descriptor & _SCALED or offset or not multiplier * divisor * base or not self.type.is_number:
            return 1.0
        return multiplier * base / divisor

    def encode(self, value: Value) -> bytes:
        """Octets as on the wire; :class:`Problem` for a value that the type cannot hold."""
        return self.type.encode(value, "little")

    def _held(self, bound: float) -> Any:
        """A bound as its octets have it: a REAL has none that is exactly 0.7."""
        return self.type.decode(self.encode(bound), "little")

    def complaint(self, octets: bytes) -> str:
        """What the file does not allow of a value, empty for nothing."""
        if len(octets) != self.type.octets:
            return f"{self.name} has {self.type.octets} octets, not {len(octets)}"
        value = self.type.decode(octets, "little")
        if not isinstance(value, int | float):
            return ""
        if self.minimum is not None and value < self._held(self.minimum):
            return f"{self.name} is {value}, below {self.minimum}"
        if self.maximum is not None and value > self._held(self.maximum):
            return f"{self.name} is {value}, above {self.maximum}"
        return ""

    def given(self, value: Value) -> bytes:
        """A user's value: a number as on the wire, or the name of one.  :class:`Problem` where that is not possible."""
        found = value
        if isinstance(value, str) and self.type.is_number:
            names = {name.casefold(): number for number, name in self.enums.items() if not self.bit_names}
            if value.strip().casefold() not in names:
                known = ", ".join(name for name in self.enums.values()) if names else "a number"
                raise Problem(f"{self.name}: {shown(value)} is no value{did_you_mean(value, names)}", known)
            found = names[value.strip().casefold()]
        elif isinstance(value, str):
            found = value.encode("latin-1", "replace")
        elif isinstance(value, bool):
            found = int(value)
        elif isinstance(value, float) and not math.isfinite(value):
            raise Problem(f"{self.name}: {shown(value)} is no finite number", "a number")
        octets = self.encode(found)
        if (wrong := self.complaint(octets)) != "":
            low, high = self.type.limits if self.type.is_number else ("", "")
            least, most = low if self.minimum is None else self.minimum, high if self.maximum is None else self.maximum
            raise Problem(wrong, f"{least} to {most}")
        return octets


@dataclass(frozen=True, slots=True)
class Member:
    """Bits of an assembly, from its bit ``place``; without a parameter they mean nothing."""

    place: int
    bits: int
    parameter: Parameter | None

    def put(self, data: bytearray, octets: bytes) -> None:
        """Write a parameter's octets, as far as there is room for their bits."""
        mask = (1 << self.bits) - 1
        whole = int.from_bytes(data, "little") & ~(mask << self.place)
        whole |= (int.from_bytes(octets, "little") & mask) << self.place
        data[:] = (whole & ((1 << 8 * len(data)) - 1)).to_bytes(len(data), "little")

    def take(self, data: bytes) -> bytes:
        """A parameter's octets out of the data; a signed one of fewer bits keeps its sign."""
        assert self.parameter is not None
        value = int.from_bytes(data, "little") >> self.place & ((1 << self.bits) - 1)
        size = self.parameter.type.octets
        if self.parameter.type.kind == "int" and self.bits < 8 * size and value >> self.bits - 1:
            value |= (1 << 8 * size) - (1 << self.bits)
        return (value & ((1 << 8 * size) - 1)).to_bytes(size, "little")


@dataclass(frozen=True, slots=True)
class Assembly:
    """``AssemN``: ``instance`` of the Assembly object, None where its path names none."""

    number: int
    name: str
    instance: int | None
    size: Limits
    members: tuple[Member, ...]


@dataclass(frozen=True, slots=True)
class Way:
    """Data of one direction: ``size`` in octets of data alone, packet interval in microseconds."""

    size: Limits
    members: tuple[Member, ...] = ()
    rpi: Limits | None = None


NO_DATA = Way(Limits(0, 0, 0))


@dataclass(frozen=True, slots=True)
class Connection:
    """``ConnectionN`` of class 1; ``path`` is the application path without key and data.  *Outputs* go to the device.

    ``points``: instances of configuration, if there is one, of outputs and inputs, in the path to class ``class_id``;
    empty for a path of another form.
    """

    keyword: str
    name: str
    help: str
    transport: int
    parameters: int
    path: bytes
    class_id: int
    points: tuple[int, ...]
    outputs: Way
    inputs: Way
    configuration: Way = NO_DATA

    @property
    def is_class_1(self) -> bool:
        return bool(self.transport & bits.CLASS_1)

    @property
    def kind(self) -> ConnectionKind:
        return next((kind for kind, bit in bits.KINDS.items() if self.transport & bit), ConnectionKind.EXCLUSIVE_OWNER)

    @property
    def triggers(self) -> frozenset[int]:
        """Production triggers: 0 cyclic, 1 change of state, 2 application; a file without these bits means cyclic."""
        return frozenset(
            number for number in range(3) if self.transport >> bits.FIRST_TRIGGER + number & 1
        ) or frozenset({0})

    @property
    def intervals(self) -> tuple[Limits, ...]:
        """Packet intervals of the directions that have one, in microseconds."""
        return tuple(way.rpi for way in (self.outputs, self.inputs) if way.rpi is not None)

    @property
    def output_sizes(self) -> frozenset[bool]:
        """Whether the size may be variable (True), fixed (False), or either; a file without these bits means any."""
        return _sizes(self.parameters, bits.FIXED_OUTPUTS)

    @property
    def input_sizes(self) -> frozenset[bool]:
        return _sizes(self.parameters, bits.FIXED_INPUTS)

    @property
    def output_header(self) -> bool:
        """Whether its outputs have the 32-bit run/idle header."""
        return self.parameters >> bits.OUTPUT_FORMAT & 7 == bits.HEADER

    @property
    def input_header(self) -> bool:
        return self.parameters >> bits.INPUT_FORMAT & 7 == bits.HEADER

    @property
    def multicast(self) -> bool:
        return bool(self.parameters & bits.INPUT_MULTICAST)

    @property
    def point_to_point(self) -> bool:
        return bool(self.parameters & bits.INPUT_POINT_TO_POINT)

    @property
    def unsupported(self) -> str:
        """Why no device of this version can offer it; empty for nothing."""
        for way, form in (("outputs", bits.OUTPUT_FORMAT), ("inputs", bits.INPUT_FORMAT)):
            number = self.parameters >> form & 7
            if number not in {bits.MODELESS, bits.HEARTBEAT, bits.HEADER}:
                return f"the real-time format {number} of its {way} is none of modeless, heartbeat and 32-bit header"
        if self.class_id != ASSEMBLY or len(self.points) not in {2, 3}:
            return "its path does not name two or three instances of the Assembly object"
        if not self.transport & sum(bits.KINDS.values()) and self.transport & bits.REDUNDANT_OWNER:
            return "it has a redundant owner alone"
        if not self.multicast and not self.point_to_point:
            return "it has neither a multicast nor a point-to-point connection to the originator"
        if self.parameters & 7 << 16 and not self.parameters & bits.OUTPUT_POINT_TO_POINT:
            return "its outputs have no point-to-point connection"
        return ""


def _sizes(parameters: int, fixed: int) -> frozenset[bool]:
    return frozenset(variable for variable in (False, True) if parameters & fixed << variable) or frozenset(
        {False, True}
    )


@dataclass(frozen=True, slots=True)
class Sheet:
    """A whole file.  ``unusable``: why a connection cannot be followed, by its keyword, which is with the line;
    ``remarks``: what contradicts itself, and how it is taken.

    ``networks`` are those that the section Device Classification names; limits of connections are 0 where the file has
    none.
    """

    key: ElectronicKey
    vendor: str
    product: str
    catalog: str
    networks: tuple[str, ...]
    port: str
    parameters: Mapping[int, Parameter]
    assemblies: Mapping[int, Assembly]
    connections: tuple[Connection, ...]
    unusable: Mapping[str, str]
    remarks: tuple[str, ...]
    io_connections: int
    explicit_connections: int

    def connection(self, wanted: str | int | None = None) -> Connection:
        """The connection of this number, keyword or name, else the first one with an exclusive owner, or the first.

        Raises :class:`ConfigError` where there is none, or where the file describes it in a way that cannot be
        followed.
        """
        usable = [one for one in self.connections if one.is_class_1]
        if isinstance(wanted, int):
            wanted = f"connection{wanted}"
        if wanted is not None and (why := self.unusable.get(wanted.casefold())) is not None:
            raise ConfigError(why)
        if not usable:
            why = next(iter(self.unusable.values()), "")
            raise ConfigError(why or "the section Connection Manager has no connection of class 1")
        if wanted is None:
            return next((one for one in usable if one.kind is ConnectionKind.EXCLUSIVE_OWNER), usable[0])
        names = {one.name.casefold(): one for one in reversed(usable)} | {one.keyword.casefold(): one for one in usable}
        if (found := names.get(wanted.casefold())) is None:
            known = ", ".join(f"{one.keyword} ({one.name})" for one in usable)
            raise ConfigError(f"there is no connection {shown(wanted)} of class 1; there are {known}")
        return found

    def named(self, name: str) -> Parameter:
        """A parameter by its name or keyword.  Raises :class:`Problem`."""
        wanted = name.strip().casefold()
        found: Sequence[Parameter] = [
            one for one in self.parameters.values() if wanted in {one.name.casefold(), f"param{one.number}"}
        ]
        if len(found) == 1:
            return found[0]
        if found:
            raise Problem(
                f"{shown(name)} is the name of several parameters", ", ".join(f"Param{p.number}" for p in found)
            )
        hint = did_you_mean(name, [one.name for one in self.parameters.values()])
        raise Problem(f"its file has no parameter {shown(name)}{hint}", "a parameter by its name or as ParamN")
