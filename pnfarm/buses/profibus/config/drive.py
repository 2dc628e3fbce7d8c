"""A group of drives on PROFIBUS, and one drive of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from pnfarm.config.drive import DriveConfig, DriveGroup

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.config.drive import Claim

__all__ = ["HIGHEST_ADDRESS", "SWITCHES_OFF", "ProfibusDriveConfig", "ProfibusDrives"]

#: Highest station address of a slave that exchanges data; 126 is that of a new one (EN 50170 part 2, 8.2).
HIGHEST_ADDRESS = 125
#: Both coding switches at F: the address parameter counts (Moog MSD manual 4.2.2).
SWITCHES_OFF = 0xFF

Address = Annotated[int, Field(ge=0, le=HIGHEST_ADDRESS)]


class ProfibusDrives(DriveGroup):
    """Keys of a group on PROFIBUS."""

    address: Annotated[int, Field(ge=0, le=SWITCHES_OFF)] = Field(
        default=SWITCHES_OFF,
        description="Coding switches S2 and S1 of the first drive as one number; counts up.  Above 125, as with both "
        "at F, the address parameter counts (PNU 918, `params: {P-0918: 5}` of a Moog MSD).",
    )
    gsd: str | None = Field(
        default=None,
        min_length=1,
        max_length=4096,
        description="The maker's GSD file, relative to this file: ident number, names, telegrams and their "
        "identifiers, octets of Set_Prm are taken from it. `identity: {gsd: FILE}` means the same.",
    )
    control_unit: Address | None = Field(
        default=None,
        description="Address that was entered with the first drive's buttons, which save it in the address parameter; "
        "counts up.",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfibusDriveConfig(DriveConfig):
    """One drive.

    ``switches``: what S2 and S1 are set to; ``control_unit``: what its buttons saved, None for nothing; ``address``:
    with which address it starts if it is not changed, None for one that the file does not say.
    """

    switches: int = SWITCHES_OFF
    control_unit: int | None = None
    address: int | None = None

    def claims(self) -> Sequence[Claim]:
        if self.address is None:
            return ()
        return (("address", ("profibus", self.address), f"station address {self.address}"),)

    def addresses(self) -> Sequence[str]:
        """Its station address, as far as the file says it."""
        return "", "" if self.address is None else str(self.address)
