"""What a GSD file says of a slave, as data; times in ns, lengths in octets."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.protocols.profibus.gsd.values import UserParameters

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.protocols.profibus.gsd.statements import GsdWarning

__all__ = ["Gsd", "ModuleItem", "SlotItem"]


@dataclass(frozen=True, slots=True)
class ModuleItem:
    """``number`` is its Module_Reference; ``parameters``: what it adds to the user's octets of Set_Prm.

    ``preset``: a new project has it.  ``safety``: it has parameters of PROFIsafe, which are not among these.
    """

    name: str
    identifiers: bytes
    number: int | None = None
    parameters: UserParameters = UserParameters()  # noqa: RUF009 - it cannot be changed
    preset: bool = False
    safety: bool = False


@dataclass(frozen=True, slots=True)
class SlotItem:
    """A slot of a SlotDefinition: the modules that it takes, by their numbers, and the one of a new project."""

    name: str
    allowed: tuple[tuple[int, int], ...]
    default: int | None = None

    def takes(self, number: int | None) -> bool:
        return number is not None and (
            number == self.default or any(first <= number <= last for first, last in self.allowed)
        )


@dataclass(frozen=True, slots=True)
class Gsd:
    """``rates``: baud rate -> longest Tsdr in bits, None where the file does not say it.

    ``most_*`` are None where the file has no limit.  ``class_one``, ``class_two``: longest record within the cyclic
    connection, and on connections of masters of class 2, of which there are ``connections``; 0 without.
    ``unit_diagnoses``: bit of the octets after the header of the device's own block -> text; ``channel_errors``:
    error type -> text.
    """

    vendor: str
    model: str
    revision: str
    ident: int
    hardware: str
    software: str
    order_number: str
    family: int
    rates: Mapping[int, int | None]
    freeze: bool
    sync: bool
    fail_safe: bool
    address_changes: bool
    modular: bool
    most_modules: int
    most_inputs: int | None
    most_outputs: int | None
    most_data: int | None
    most_parameters: int | None
    most_diagnosis: int
    v1: bool
    class_one: int
    class_two: int
    connections: int
    interval_ns: int
    parameters: UserParameters
    modules: tuple[ModuleItem, ...]
    slots: Mapping[int, SlotItem]
    unit_diagnoses: Mapping[int, str]
    channel_errors: Mapping[int, str]
    warnings: tuple[GsdWarning, ...] = field(default=(), compare=False)
