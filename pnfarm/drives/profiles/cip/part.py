"""What a model has of CIP: its parameter instances and the attributes of its application objects.

``instances.csv`` has the rows of the Parameter object (class 0x0F): the size and the scaling of each value on the wire.
``attributes.csv`` has the attributes of the application objects.  Both are read for a model with the profile ``cip``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

from pnfarm.drives.description.files import integer, rows
from pnfarm.drives.parameters.parameter import ParameterType
from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.drives.description.files import ModelFiles
    from pnfarm.drives.parameters.parameter import Parameter

__all__ = ["ATTRIBUTE_SIZES", "CIP", "Cip", "CipAttribute", "CipInstance", "Scaling", "read_cip"]

#: As a model names its profile.
CIP = "cip"
#: Widths of the elementary types that attributes have (CIP volume 1, appendix C), octets.
ATTRIBUTE_SIZES = {"BOOL": 1, "USINT": 1, "INT": 2, "DINT": 4, "UDINT": 4}
#: Types without a width of their own.
OPEN_TYPES = frozenset({"USINT[]", "parameter"})
#: Codes of the types by width: signed, unsigned (CIP volume 1, appendix C; AKD EtherNet/IP manual 7.3.1).
_CODES = {1: (0xC2, 0xC6), 2: (0xC3, 0xC7), 4: (0xC4, 0xC8), 8: (0xC5, 0xC9)}


class Scaling(Enum):
    """How a parameter's value goes on the wire."""

    INTEGER = "integer"
    FLOAT = "float"  # times 1000
    POSITION = "position"  # in position units
    VELOCITY = "velocity"  # in profile units
    ACCELERATION = "acceleration"  # in profile units
    COMMAND = "command"  # writing acts

    @property
    def profile(self) -> bool:
        """Whether it is in profile units."""
        return self in {Scaling.VELOCITY, Scaling.ACCELERATION}


@dataclass(frozen=True, slots=True)
class CipInstance:
    """One instance of the Parameter object; ``size`` in octets.  ``number`` is its parameter's number, too."""

    number: int
    name: str
    size: int
    signed: bool
    scaling: Scaling
    source: str
    note: str

    @property
    def type_code(self) -> int:
        """Attribute 5."""
        return _CODES[self.size][0 if self.signed else 1]


@dataclass(frozen=True, slots=True)
class CipAttribute:
    """One attribute of an application object; None is no limit but its type's."""

    class_id: int
    number: int
    name: str
    readable: bool
    writable: bool
    type: str
    minimum: int | None
    maximum: int | None
    source: str
    note: str

    @property
    def size(self) -> int:
        """Octets, 0 where the type gives none."""
        return ATTRIBUTE_SIZES.get(self.type, 0)

    @property
    def signed(self) -> bool:
        """Whether the value has a sign."""
        return self.type in {"INT", "DINT"}


@dataclass(frozen=True, slots=True)
class Cip:
    """Empty for a drive that does not speak CIP."""

    instances: Mapping[int, CipInstance] = field(default_factory=dict)
    #: (class, attribute) -> its row.
    attributes: Mapping[tuple[int, int], CipAttribute] = field(default_factory=dict)


def read_cip(files: ModelFiles, parameters: Mapping[int, Parameter]) -> Cip:
    """Both tables; raises :class:`ConfigError` with file, line and column."""
    instances: dict[int, CipInstance] = {}
    for path in files.wanted("instances.csv"):
        for where, row in rows(path):
            found = _instance(row, where, parameters)
            if found.number in instances:
                raise ConfigError(f"{where}, instance: {found.number} is given twice")
            instances[found.number] = found
    attributes: dict[tuple[int, int], CipAttribute] = {}
    for path in files.wanted("attributes.csv"):
        for where, row in rows(path):
            attribute = _attribute(row, where)
            key = (attribute.class_id, attribute.number)
            if key in attributes:
                raise ConfigError(f"{where}, attribute: {attribute.number} is given twice")
            attributes[key] = attribute
    return Cip(instances, attributes)


def _instance(row: Mapping[str, str], where: str, parameters: Mapping[int, Parameter]) -> CipInstance:
    number = integer(row["instance"], where, "instance")
    parameter = parameters.get(number)
    if parameter is None:
        raise ConfigError(f"{where}, instance: there is no parameter {number}")
    try:
        scaling = Scaling(row["scaling"])
    except ValueError:
        known = ", ".join(one.value for one in Scaling)
        raise ConfigError(f"{where}, scaling: {row['scaling']!r} is not one of {known}") from None
    size = integer(row["size"], where, "size")
    if size != parameter.octets:
        raise ConfigError(f"{where}, size: {size} octets, but {parameter.name} has {parameter.octets}")
    if row["signed"] not in {"0", "1"} or (row["signed"] == "1") != parameter.signed:
        raise ConfigError(f"{where}, signed: {row['signed']!r} is not as of {parameter.name}")
    if (scaling is Scaling.COMMAND) != (parameter.type is ParameterType.COMMAND):
        raise ConfigError(f"{where}, scaling: {row['scaling']!r} does not go with the type of {parameter.name}")
    if (scaling is Scaling.POSITION) != (parameter.scale == "position"):
        raise ConfigError(f"{where}, scaling: {row['scaling']!r} does not go with the scale of {parameter.name}")
    if parameter.elements:
        raise ConfigError(f"{where}, instance: {parameter.name} is an array")
    for column in ("name", "source"):
        if not row[column]:
            raise ConfigError(f"{where}, {column}: empty")
    if row["source"] == "assumed" and not row["note"]:
        raise ConfigError(f"{where}, note: an assumed value needs its reason")
    return CipInstance(number, row["name"], size, parameter.signed, scaling, row["source"], row["note"])


def _attribute(row: Mapping[str, str], where: str) -> CipAttribute:
    access = row["access"].split()
    if not access or set(access) - {"get", "set"}:
        raise ConfigError(f"{where}, access: {row['access']!r} is not get, set, or both")
    if row["type"] not in ATTRIBUTE_SIZES.keys() | OPEN_TYPES:
        known = ", ".join(sorted(ATTRIBUTE_SIZES.keys() | OPEN_TYPES))
        raise ConfigError(f"{where}, type: {row['type']!r} is not one of {known}")
    if not row["source"]:
        raise ConfigError(f"{where}, source: empty")
    lowest, highest = (integer(row[key], where, key) if row[key] else None for key in ("min", "max"))
    return CipAttribute(
        class_id=integer(row["class"], where, "class"),
        number=integer(row["attribute"], where, "attribute"),
        name=row["name"],
        readable="get" in access,
        writable="set" in access,
        type=row["type"],
        minimum=lowest,
        maximum=highest,
        source=row["source"],
        note=row["note"],
    )
