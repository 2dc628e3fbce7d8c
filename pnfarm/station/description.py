"""What a station is by its maker's description: identity, access point, modules; for views."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["ModuleDescription", "StationDescription", "SubmoduleDescription"]


@dataclass(frozen=True, slots=True)
class SubmoduleDescription:
    """``safety``: it speaks a safety protocol to its controller, which the farm does not run."""

    subslot: int
    ident: int
    name: str
    input_octets: int
    output_octets: int
    safety: bool = False


@dataclass(frozen=True, slots=True)
class ModuleDescription:
    """A module in its slot."""

    slot: int
    ident: int
    name: str
    submodules: tuple[SubmoduleDescription, ...] = ()


@dataclass(frozen=True, slots=True)
class StationDescription:
    """``title`` names the product; ``identity`` has what its bus identifies it by, such as ``vendor_id``."""

    title: str
    identity: Mapping[str, str | int] = field(default_factory=dict)
    access_point: str = ""
    modules: tuple[ModuleDescription, ...] = ()
