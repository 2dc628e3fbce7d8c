"""A slave of the built-in master that no model describes: its maker's GSD file does."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pnfarm.buses.profibus.config.drive import Address
from pnfarm.config.section import Section
from pnfarm.config.values import NamePattern, OctetString

__all__ = ["GsdDevice"]


class GsdDevice(Section):
    """A slave without a model, described by its maker's GSD file."""

    name: NamePattern = Field(description="Its name in this file; on the line it has none.")
    gsd: str = Field(min_length=1, description="Its GSD file, relative to this file.")
    address: Address = Field(description="Its station address.")
    modules: list[Annotated[str, Field(min_length=1)] | int | None] = Field(
        default_factory=list,
        max_length=244,
        description="Its modules in the order of its slots, by names or numbers as the GSD file has them; null for an "
        "empty slot; left out, the only one.",
    )
    user: OctetString | None = Field(
        default=None,
        description="Octets of Set_Prm after the seven of the standard, in hexadecimal; left out, those of the file.",
    )
    outputs: OctetString | None = Field(
        default=None, description="Its outputs in hexadecimal, the same all the time; left out, zeros."
    )
