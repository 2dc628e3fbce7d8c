"""Modules in the bodies of the API."""

from __future__ import annotations

from pydantic import Field

from pnfarm.web.bodies import Schema

__all__ = ["Module", "ModulePlug", "ModulesView", "PluggedView", "Submodule"]


class Submodule(Schema):
    """One submodule as it is plugged."""

    subslot: str = Field(description="Hexadecimal.")
    submodule_ident: str = Field(description="Hexadecimal.")
    api: str = Field(description="Hexadecimal.")
    input_bytes: int
    output_bytes: int
    owner: str | None = Field(description="The controller or supervisor that has it.")
    awaits_parameters: bool = Field(description="Plugged or released; its owner has not parametrised it yet.")


class Module(Schema):
    """One slot."""

    slot: int
    module_ident: str | None = Field(description="Hexadecimal; null: the slot is empty.")
    telegram: int | None = Field(description="The telegram whose module it is.")
    held: bool = Field(description="Pulled or plugged on purpose: the slot does not follow the controller.")
    substitute: bool = Field(description="It works in place of another module.")
    submodules: list[Submodule]


class ModulesView(Schema):
    drive: str
    modules: list[Module]


class PluggedView(ModulesView):
    changed: bool = Field(description="False when the module was there already.")


class ModulePlug(Schema):
    """What to plug: a telegram's module, one of any ident, or (neither) the one that was pulled."""

    telegram: int | None = None
    module_ident: int | None = Field(default=None, ge=1, le=0xFFFFFFFF)
    substitute: bool = Field(default=False, description="It works in place of what the controller expects.")
