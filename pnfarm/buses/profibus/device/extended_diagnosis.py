"""What a drive tells of its fault behind the first six octets of a diagnosis (Moog MSD manual 9.5.1, table 9.21)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pnfarm.buses.profibus.device.product import Product

__all__ = ["extended_diagnosis", "extended_octets"]

#: ERR_ErrorID and ERR_WRN_State.
_NUMBER_OCTETS = 4


def extended_diagnosis(product: Product, mode: int, error: int, warning: int) -> bytes:
    """The status block of DP-V1: header, error, warning; empty where ``mode`` (P-1256) asks for none.

    ``error``: number in the lower word, location in the upper one, 0 without a fault (error 11, location 1 is
    0x0001000B); ``warning`` likewise.  Both fit in four octets.
    """
    if mode not in product.diagnosis_modes:
        return b""
    numbers = (number.to_bytes(_NUMBER_OCTETS, "big") for number in (error, warning))
    return bytes(product.diagnosis_header) + b"".join(numbers)


def extended_octets(product: Product) -> int:
    """Its length."""
    return len(product.diagnosis_header) + 2 * _NUMBER_OCTETS
