"""H1 to H3: how each lamp is lit in each state of the slave (Moog MSD manual 4.2.1, table 4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.buses.profibus.device.product import Product

__all__ = ["LampState", "lamps"]


@dataclass(frozen=True, slots=True)
class LampState:
    """What the lamps show.

    ``found``: the baud rate is known; ``exchanged``: data were exchanged since power on; ``class_two``: a connection
    of class 2 is open; ``parameters_wrong``, ``configuration_wrong``: the last Set_Prm or Chk_Cfg was refused.
    """

    powered: bool = True
    booting: bool = False
    found: bool = False
    exchanged: bool = False
    exchanging: bool = False
    clear: bool = False
    class_two: bool = False
    parameters_wrong: bool = False
    configuration_wrong: bool = False


def lamps(product: Product, state: LampState) -> dict[str, str]:
    """Each lamp by its name: ``on``, ``off`` or how it flashes; without supply all are off."""
    if not state.powered:
        return dict.fromkeys(product.lamp_names, "off")
    return dict(zip(product.lamp_names, _lit(product, state), strict=True))


def _lit(product: Product, state: LampState) -> tuple[str, ...]:
    if state.booting:
        return product.lamp_boot
    if not state.found:
        return product.lamp_search_again if state.exchanged else product.lamp_search
    if state.exchanging:
        # the table has no row for both: a person at the drive looks for a controller in STOP
        if state.clear:
            return product.lamp_clear
        return product.lamp_class_2 if state.class_two else product.lamp_exchange
    if state.parameters_wrong:
        return product.lamp_parameters
    return product.lamp_configuration if state.configuration_wrong else product.lamp_wait
