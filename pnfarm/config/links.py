"""Links to which drives and controllers are attached."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field

from pnfarm.config.section import Section
from pnfarm.config.values import Interface

__all__ = ["LINK_KINDS", "Link", "MacvlanLink", "MemoryLink", "TapLink", "VethLink"]


class MacvlanLink(Section):
    """One macvlan per drive on an interface of this machine: the drives are on the real network."""

    kind: Literal["macvlan"]
    parent: Interface = Field(description="Parent interface, such as eth1; it must be up.")
    transmit: Literal["interface", "parent"] = Field(
        default="interface",
        description="Where cyclic frames leave: each drive's own interface, or the parent, which costs less "
        "but does not reach a controller on this machine.",
    )


class VethLink(Section):
    """One veth pair per drive, joined by a bridge: a farm and a controller on one machine."""

    kind: Literal["veth"]
    bridge: Interface | None = Field(
        default=None, description="Existing bridge to join; left out, the farm makes its own."
    )


class TapLink(Section):
    """One TAP per drive: for virtual machines, or where no other interface can be made.  Slower."""

    kind: Literal["tap"]
    bridge: Interface | None = Field(default=None, description="Existing bridge to join; left out, the TAPs join none.")


class MemoryLink(Section):
    """No network and no rights: the drives and the file's controller in one process, on one clock."""

    kind: Literal["memory"]


Link = Annotated[MacvlanLink | VethLink | TapLink | MemoryLink, Discriminator("kind")]


#: By the value of `kind`, as messages list them.
LINK_KINDS: dict[str, type[MacvlanLink | VethLink | TapLink | MemoryLink]] = {
    "macvlan": MacvlanLink,
    "veth": VethLink,
    "tap": TapLink,
    "memory": MemoryLink,
}
