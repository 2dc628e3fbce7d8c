"""Faults and warnings of a drive that its model does not have, or has under another name."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pnfarm.config.section import Section
from pnfarm.drives.description.parts import REACTIONS, Fault

__all__ = ["MAX_FAULTS", "OwnFault", "drive_fault"]

#: Most of one drive.
MAX_FAULTS = 256

Name = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f]{1,80}$")]


class OwnFault(Section):
    """One fault or warning, by its number."""

    number: int = Field(ge=1, lt=1 << 16, description="Its number; it replaces the model's with this number.")
    name: Name = Field(description="Its text.")
    kind: Literal["fault", "warning"] = Field(default="fault", description="A warning leaves the axis running.")
    reaction: Literal["coast", "quick-stop"] = Field(default="coast", description="How a fault stops the axis.")


def drive_fault(own: OwnFault) -> Fault:
    """The fault as a model has it."""
    warning = own.kind == "warning"
    reaction = 0 if warning else REACTIONS[own.reaction]
    return Fault(own.number, own.name, warning, reaction, "", "farm file", "", own.number)
