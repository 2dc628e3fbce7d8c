"""Interfaces that a farm made."""

from __future__ import annotations

import re

from pnfarm.links.kernel.ownership import interface_prefix

__all__ = ["own_interfaces"]


def own_interfaces(ip, farm: str = "solo") -> list[str]:
    """What stands there of a farm and of its controller."""
    prefixes = (interface_prefix(farm), interface_prefix(f"{farm} plc"))
    return [name for name in re.findall(r"^\d+: ([^:@]+)", ip("-o", "link"), re.MULTILINE) if name.startswith(prefixes)]
