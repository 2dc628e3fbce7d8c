"""What a model says of its EtherNet/IP device: identity and assemblies (its section ``ethernetip``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model

__all__ = ["Product"]

_U8, _U16 = 0xFF, 0xFFFF
#: Longest product name (CIP volume 1, 5A-2.2), octets.
_LONGEST_NAME = 32
#: Most octets of an assembly: a class 1 connection of a small Forward_Open carries 511 with its headers.
_MOST_OCTETS = 496


@dataclass(frozen=True, slots=True)
class Product:
    """Sizes in octets of data alone; ``*_run_idle``: whether these data have the header."""

    vendor_id: int
    device_type: int
    product_code: int
    product_name: str
    revision: tuple[int, int]
    input_assembly: int
    input_size: int
    input_run_idle: bool
    output_assembly: int
    output_size: int
    output_run_idle: bool
    configuration_assembly: int
    configuration_size: int
    input_only_assembly: int
    listen_only_assembly: int
    min_rpi_ns: int
    interval_step_ns: int
    null_open_status: int
    io_connections: int
    explicit_connections: int
    sessions: int

    @classmethod
    def of(cls, model: Model) -> Product:
        """Raises :class:`ConfigError` for a model whose section is not complete."""
        values: dict[str, Any] = {}
        for key, check in _FIELDS.items():
            fact = model.bus_facts.get(key)
            if fact is None:
                raise ConfigError(f"{model.name}: [ethernetip] has no {key}")
            if not check(fact.value):
                raise ConfigError(f"{model.name}: [ethernetip] {key} = {fact.value!r} is not possible")
            values[key] = tuple(fact.value) if isinstance(fact.value, list) else fact.value
        return cls(**values)


def _number(highest: int, lowest: int = 0) -> Any:
    return lambda value: type(value) is int and lowest <= value <= highest


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool)


_FIELDS: dict[str, Any] = {
    "vendor_id": _number(_U16),
    "device_type": _number(_U16),
    "product_code": _number(_U16),
    "product_name": lambda value: isinstance(value, str) and 0 < len(value) <= _LONGEST_NAME,
    "revision": lambda value: len(value) == 2 and all(type(part) is int and 0 < part <= _U8 for part in value),
    "input_assembly": _number(_U16, 1),
    "input_size": _number(_MOST_OCTETS),
    "input_run_idle": _is_flag,
    "output_assembly": _number(_U16, 1),
    "output_size": _number(_MOST_OCTETS),
    "output_run_idle": _is_flag,
    "configuration_assembly": _number(_U16, 1),
    "configuration_size": _number(_MOST_OCTETS),
    "input_only_assembly": _number(_U16, 1),
    "listen_only_assembly": _number(_U16, 1),
    "min_rpi_ns": _number(10_000_000_000, 1000),
    "interval_step_ns": _number(1_000_000_000, 1000),
    "null_open_status": _number(_U16),
    "io_connections": _number(32, 1),
    "explicit_connections": _number(64),
    "sessions": _number(64, 1),
}
