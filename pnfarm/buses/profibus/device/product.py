"""What a model says of its slave (its section ``profibus``), checked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.errors import ConfigError, DecodeError
from pnfarm.protocols.profibus.wire.dp import parse_identifiers
from pnfarm.protocols.profibus.wire.timing import BAUD_RATES

if TYPE_CHECKING:
    from pnfarm.drives.description.model import Model

__all__ = ["Product"]


@dataclass(frozen=True, slots=True)
class Product:
    """Times in ns or bits; lamps: one text for each of ``lamp_names``.  The ident number is the model's
    device id.  Lamps are empty of a drive without.

    ``diagnosis_parameter`` says by ``diagnosis_modes`` whether the octets of a fault are sent, which begin with
    ``diagnosis_header``; None of a drive that reports its faults as errors of channels.  ``parameters``: octets of the
    user in Set_Prm as a maker's file has them, none for a drive that takes any.
    """

    max_tsdr_bits: tuple[int, ...]
    baud_rates: tuple[int, ...]
    baud_codes: tuple[int, ...]
    silence_ns: int
    freeze: bool
    sync: bool
    fail_safe: bool
    address_changes: bool
    connections: int
    longest_record: int
    send_timeout_ns: int
    class_two_exchanged: bool
    #: Answers with eight octets of data go as SD3.
    fixed_length: bool
    address_parameter: int
    #: It is read as the address in force, also where the switches give that.
    address_in_force: bool
    baud_parameter: int
    lamp_names: tuple[str, ...] = ()
    lamp_boot: tuple[str, ...] = ()
    lamp_search: tuple[str, ...] = ()
    lamp_search_again: tuple[str, ...] = ()
    lamp_wait: tuple[str, ...] = ()
    lamp_exchange: tuple[str, ...] = ()
    lamp_clear: tuple[str, ...] = ()
    lamp_class_2: tuple[str, ...] = ()
    lamp_parameters: tuple[str, ...] = ()
    lamp_configuration: tuple[str, ...] = ()
    diagnosis_parameter: int | None = None
    diagnosis_modes: tuple[int, ...] = ()
    diagnosis_header: tuple[int, ...] = ()
    parameters: tuple[int, ...] = ()

    @classmethod
    def of(cls, model: Model) -> Product:
        """Raises :class:`ConfigError` for a model whose section is not complete."""
        values: dict[str, Any] = {}
        for key, fits in _FIELDS.items():
            fact = model.bus_facts.get(key)
            if fact is None and any(key in group and not group & model.bus_facts.keys() for group in _OPTIONAL):
                continue
            if fact is None:
                raise ConfigError(f"{model.name}: [profibus] has no {key}")
            value = tuple(fact.value) if isinstance(fact.value, list) else fact.value
            if not fits(value):
                raise ConfigError(f"{model.name}: [profibus] {key} = {fact.value!r} is not possible")
            values[key] = value
        lamps = {len(value) for key, value in values.items() if key.startswith("lamp_")}
        if len(lamps) > 1:
            raise ConfigError(f"{model.name}: [profibus] each state needs as many entries as there are lamp_names")
        if len({len(values[key]) for key in ("baud_rates", "baud_codes", "max_tsdr_bits")}) > 1:
            raise ConfigError(f"{model.name}: [profibus] each of baud_rates needs its code and its max_tsdr_bits")
        for key in ("address_parameter", "baud_parameter", "diagnosis_parameter"):
            if key in values and values[key] not in model.parameters:
                raise ConfigError(f"{model.name}: [profibus] {key}: there is no parameter {values[key]}")
        _check_telegrams(model)
        return cls(**values)

    def baud_code(self, baud: int) -> int:
        """The code of a rate in the baud parameter, 0 for one that it has not."""
        return dict(zip(self.baud_rates, self.baud_codes, strict=True)).get(baud, 0)


def _check_telegrams(model: Model) -> None:
    """Each telegram's identifiers have the lengths of its words."""
    for number, telegram in model.profidrive.telegrams.items():
        try:
            parts = parse_identifiers(telegram.identifiers)
        except DecodeError as exc:
            raise ConfigError(f"{model.name}: telegram {number}: its identifiers are cut off: {exc.detail}") from exc
        words = 2 * len(telegram.output), 2 * len(telegram.input)
        named = sum(part.outputs for part in parts), sum(part.inputs for part in parts)
        if words != named:
            raise ConfigError(
                f"{model.name}: telegram {number} has {words[0]} octets of outputs and {words[1]} of inputs, "
                f"its identifiers say {named[0]} and {named[1]}"
            )


def _number(lowest: int, highest: int) -> Any:
    return lambda value: type(value) is int and lowest <= value <= highest


def _numbers(lowest: int, highest: int) -> Any:
    one = _number(lowest, highest)
    return lambda value: isinstance(value, tuple) and all(one(each) for each in value)


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool)


def _are_texts(value: Any) -> bool:
    return isinstance(value, tuple) and bool(value) and all(isinstance(one, str) and one for one in value)


_FIELDS: dict[str, Any] = {
    "max_tsdr_bits": _numbers(11, 1000),
    "baud_rates": lambda value: isinstance(value, tuple) and set(value) <= set(BAUD_RATES),
    "baud_codes": _numbers(0, 0xFFFF),
    "silence_ns": _number(0, 600_000_000_000),
    **dict.fromkeys(
        (
            "freeze", "sync", "fail_safe", "address_changes", "address_in_force", "class_two_exchanged", "fixed_length",
        ),
        _is_flag,
    ),
    "connections": _number(0, 49),
    "longest_record": _number(1, 240),
    "send_timeout_ns": _number(10_000_000, 600_000_000_000),
    **dict.fromkeys(("address_parameter", "baud_parameter", "diagnosis_parameter"), _number(1, 0xFFFF)),
    "diagnosis_modes": _numbers(0, 0xFFFF),
    **dict.fromkeys(("diagnosis_header", "parameters"), _numbers(0, 0xFF)),
    **dict.fromkeys(
        (
            "lamp_names", "lamp_boot", "lamp_search", "lamp_search_again", "lamp_wait", "lamp_exchange", "lamp_clear",
            "lamp_class_2", "lamp_parameters", "lamp_configuration",
        ),
        _are_texts,
    ),
}  # fmt: skip
#: Of each group all, or none.
_OPTIONAL = (
    frozenset({"diagnosis_parameter", "diagnosis_modes", "diagnosis_header"}),
    frozenset({"parameters"}),
    frozenset(key for key in _FIELDS if key.startswith("lamp_")),
)
