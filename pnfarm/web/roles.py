"""What a client may do: each route names the least role that it needs, each token has one."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["Role"]


class Role(StrEnum):
    """From the least to the most; each may do what those before it may."""

    #: See everything.
    READ = "read"
    #: Disturb drives, devices and plant: faults, signals, parameters, power, modules, scenarios, traces.
    INJECT = "inject"
    #: Everything, also what replaces or deletes what others have: saved states.
    ADMIN = "admin"

    def covers(self, needed: Role) -> bool:
        """Whether this role may do what needs ``needed``."""
        order = list(Role)
        return order.index(self) >= order.index(needed)
