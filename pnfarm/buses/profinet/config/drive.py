"""A group of drives on PROFINET, and one drive of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from pnfarm.buses.profinet.config.values import WANTED, Cycle, Wanted
from pnfarm.config.drive import MAX_AXES, AxisGroup
from pnfarm.config.ip import IpDriveConfig, IpDrives
from pnfarm.config.values import Cidr
from pnfarm.protocols.profinet.cm.controller.plan import MAX_SLOT

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pnfarm.buses.profinet.maker_file import MakerFile

__all__ = ["ProfinetAxis", "ProfinetDriveConfig", "ProfinetDrives"]

_U16 = 0xFFFF


class ProfinetAxis(AxisGroup):
    """One axis of a drive on PROFINET."""

    telegram: int | None = Field(default=None, ge=0, le=_U16, description="PROFIdrive telegram; left out, the drive's.")
    slot: int | None = Field(
        default=None,
        ge=1,
        le=MAX_SLOT,
        description="Slot of its module; left out, the next one after the previous axis.",
    )
    supplementary: int | None = Field(
        default=None, ge=0, le=_U16, description="Supplementary telegram in addition to it; left out, the drive's."
    )


class ProfinetDrives(IpDrives):
    """Keys of a group on PROFINET."""

    ip: Cidr | None = Field(
        default=None, description="First drive's address; counts up.  Left out, the drive waits for DCP."
    )
    telegram: int | None = Field(default=None, ge=0, le=_U16, description="PROFIdrive telegram; left out, the model's.")
    supplementary: int | None = Field(
        default=None,
        ge=0,
        le=_U16,
        description="Supplementary telegram in a separate submodule in addition to the telegram's, such as 750: it is "
        "plugged at first, and the built-in controller plugs it.",
        examples=[750],
    )
    gsdml: str | None = Field(
        default=None,
        min_length=1,
        max_length=4096,
        description="The maker's GSDML file, relative to this file: vendor, device, access point, modules, submodules "
        "and order number are taken from it. `identity: {gsdml: FILE}` means the same.",
    )
    access_point: Wanted | None = Field(
        default=None, description=f"{WANTED} of the file's access point; left out, the one with most telegrams."
    )
    axes: list[ProfinetAxis] = Field(
        default_factory=list,
        max_length=MAX_AXES,
        description="Several axes on one connection, each with a telegram in its own slots, in this order. A "
        "model takes more axes than its manual has (`pnfarm models MODEL`) with `limits: lax`.",
        examples=[[{"name": "x"}, {"name": "y"}]],
    )
    isochronous: Literal["refuse", "ignore"] = Field(
        default="refuse",
        description="Records with which a controller requests isochronous operation (IsochronousModeData, PDIRData, "
        "PDSyncData): refuse them, or ignore them: the drive keeps them and runs in RT without the clock. A connection "
        "with RT class 3 (IRT) is refused either way.",
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

    ``telegram`` is None where the file leaves it to the model, ``supplementary`` where there is none, ``cycle_ns``
    where the controller's counts.  ``ignores_clock``: a controller may ask for isochronous operation.
    ``maker``: its maker's file, None without one.
    For a foreign device (a file without ``farm:``) ``mac`` means nothing: the controller finds it by name.
    """

    telegram: int | None = None
    supplementary: int | None = None
    ignores_clock: bool = False
    hello: bool = False
    cycle_ns: int | None = None
    maker: MakerFile | None = None

    def of_axis(self) -> Mapping[str, Any]:
        return {"telegram": self.telegram, "supplementary": self.supplementary}

    def addresses(self) -> Sequence[str]:
        mac, ip = IpDriveConfig.addresses(self)
        return mac, ip or "by DCP"
