"""A group of drives on PROFINET, and one drive of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pydantic import Field

from pnfarm.buses.profinet.config.values import Cycle
from pnfarm.config.drive import MAX_AXES, AxisGroup
from pnfarm.config.ip import IpDriveConfig, IpDrives
from pnfarm.config.values import Cidr
from pnfarm.protocols.profinet.cm.controller.plan import MAX_SLOT

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["ProfinetDriveConfig", "ProfinetDrives"]

_U16 = 0xFFFF


class ProfinetAxis(AxisGroup):
    """One axis of a drive on PROFINET."""

    telegram: int | None = Field(default=None, ge=0, le=_U16, description="PROFIdrive telegram; left out, the drive's.")
    slot: int | None = Field(
        default=None,
        ge=1,
        le=MAX_SLOT,
        description="Slot of its module; left out, the one behind the axis before it.",
    )


class ProfinetDrives(IpDrives):
    """Keys of a group on PROFINET."""

    ip: Cidr | None = Field(
        default=None, description="First drive's address; counts up.  Left out, the drive waits for DCP."
    )
    telegram: int | None = Field(default=None, ge=0, le=_U16, description="PROFIdrive telegram; left out, the model's.")
    axes: list[ProfinetAxis] = Field(
        default_factory=list,
        max_length=MAX_AXES,
        description="Several axes on one connection, each with a telegram in slots of its own, behind each other. A "
        "model takes more axes than its manual has (`pnfarm models MODEL`) with `limits: lax`.",
        examples=[[{"name": "x"}, {"name": "y"}]],
    )
    hello: bool = Field(
        default=False,
        description="Whether the drive sends DCP Hello at power-on; a controller's fast start-up record overrides it.",
    )
    cycle_ns: Cycle | None = Field(
        default=None, alias="cycle", description="Cycle at which the built-in controller runs these drives."
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfinetDriveConfig(IpDriveConfig):
    """One drive.

    ``telegram`` is None where the file leaves it to the model, ``cycle_ns`` where the controller's counts.
    For a foreign device (a file without ``farm:``) ``mac`` means nothing: the controller finds it by name.
    """

    telegram: int | None = None
    hello: bool = False
    cycle_ns: int | None = None

    def of_axis(self) -> Mapping[str, Any]:
        return {"telegram": self.telegram}

    def addresses(self) -> Sequence[str]:
        mac, ip = IpDriveConfig.addresses(self)
        return mac, ip or "by DCP"
