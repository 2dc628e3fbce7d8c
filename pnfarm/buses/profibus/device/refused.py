"""What a master configured and a slave does not have so, in sentences, with the key of the farm file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.station.visits import Refusal

if TYPE_CHECKING:
    from pnfarm.buses.profibus.device.kind import Kind
    from pnfarm.protocols.profibus.slave_user import ConfigurationRefused, ParametersRefused

__all__ = ["of_configuration", "of_parameters"]


def of_parameters(event: ParametersRefused, own_ident: int, kind: Kind) -> Refusal:
    """Set_Prm did not fit (Prm_Fault): another ident number is another GSD file."""
    return Refusal(f"Set_Prm refused: {event.why}", kind.parameters_key if event.ident == own_ident else ("gsd",))


def of_configuration(event: ConfigurationRefused, own: bytes, kind: Kind) -> Refusal:
    """Chk_Cfg did not fit (Cfg_Fault)."""
    text = "Chk_Cfg refused: the master expects identifiers "
    if event.identifiers == own:
        return Refusal(f"{text}{own.hex(' ')}, which are the slave's: a fault refuses them")
    found = kind.difference(event.identifiers)
    place, where = "", ""
    key: tuple[str | int, ...] = ("gsd",)
    if found is not None:
        slot, name = found
        place, key = str(slot), ("slots", str(slot))
        where = f"; the first difference is in slot {slot}" + (f", where {name} would fit" if name else "")
    return Refusal(f"{text}{event.identifiers.hex(' ') or 'none'}, the slave has {own.hex(' ')}{where}", key, place)
