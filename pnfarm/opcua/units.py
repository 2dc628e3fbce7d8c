"""Units as OPC UA names them: the common codes of UN/ECE recommendation 20 (OPC 10000-8, 5.6.4.3)."""

from __future__ import annotations

from asyncua import ua

__all__ = ["engineering_units"]

_CODES = {
    "%": "P1", "A": "AMP", "Hz": "HTZ", "N": "NEW", "Nm": "NU", "V": "VLT", "W": "WTT", "bar": "BAR", "deg": "DD",
    "g": "GRM", "kg": "KGM", "l/min": "L2", "m": "MTR", "m/s": "MTS", "mm": "MMT", "ms": "C26", "rad": "C81",
    "revolutions": "M44", "rpm": "RPM", "s": "SEC", "°C": "CEL",
}  # fmt: skip
_UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"


def engineering_units(unit: str) -> ua.EUInformation:
    """A unit without a known code has the id -1."""
    code = _CODES.get(unit)
    return ua.EUInformation(
        NamespaceUri=_UNECE if code else "",
        UnitId=int.from_bytes(code.encode(), "big") if code else -1,
        DisplayName=ua.LocalizedText(unit),
        Description=ua.LocalizedText(unit),
    )
