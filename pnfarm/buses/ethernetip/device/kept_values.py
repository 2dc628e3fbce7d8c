"""What a drive on EtherNet/IP keeps in its non-volatile memory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.station.kept_values import FAULTS, Shape, check_shapes, drive_shape, is_number

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["check_kept"]

#: QoS attributes 4 to 8, and their highest value; longest inactivity timeout of the encapsulation, s.
_DSCPS, _HIGHEST_DSCP, _LONGEST_INACTIVITY = frozenset({"4", "5", "6", "7", "8"}), 63, 3600
#: Attribute 11 of the TCP/IP Interface object: activity, MAC address, ARP packet.
_CONFLICT_OCTETS = 1 + 6 + 28

_SHAPES: Mapping[str, Shape] = {
    "qos": (
        lambda value: (
            isinstance(value, dict)
            and value.keys() <= _DSCPS
            and all(is_number(dscp, _HIGHEST_DSCP) for dscp in value.values())
        ),
        "numbers to 63 by attribute, 4 to 8",
    ),
    "conflict_detection": (lambda value: isinstance(value, bool), "true or false"),
    "inactivity_timeout": (lambda value: is_number(value, _LONGEST_INACTIVITY), "seconds, 0 to 3600"),
    "last_conflict": (
        lambda value: isinstance(value, bytes) and len(value) == _CONFLICT_OCTETS,
        f"{_CONFLICT_OCTETS} octets",
    ),
    "faults": FAULTS,
    "drive": drive_shape(octets=8),
}


def check_kept(values: Mapping[str, Any]) -> None:
    """Raises :class:`KeptValueError` that names the first key with a wrong value, and that value."""
    check_shapes(values, _SHAPES)
