"""Fields of the axis record: supply."""

from __future__ import annotations

from pnfarm.table.layout import Field, subject

__all__ = ["SUPPLY_RECORD"]

SUPPLY_RECORD = subject(
    "supply",
    "The DC link and what feeds it.",
    settings=[
        Field("nominal", "f8", "V", "station", "DC link voltage held by the mains, 0 = the voltage limits nothing"),
        Field("capacitance", "f8", "F", "station", "of the DC link, 0 = its voltage is constant"),
        Field("load", "f8", "W", "station", "what the drive itself takes from the DC link"),
        Field(
            "brake", "f8", "V", "station", "voltage at which the braking resistor holds the DC link, 0 = no resistor"
        ),
        Field("limit", "f8", "V", "station", "DC link voltage that is a fault, 0 = none"),
        Field("levels", "f8", "V", "parameter", "DC link voltage below and above which it warns, 0 = none", (2,)),
        Field("undervoltage_limit", "f8", "V", "parameter", "DC link voltage below which it is a fault, 0 = none"),
        Field("overvoltage_fault", "u4", "", "parameter", "that fault, number | reaction << 24, 0 = none"),
        Field("undervoltage_fault", "u4", "", "parameter", "that fault, number | reaction << 24, 0 = none"),
        Field("warning", "u4", "", "parameter", "warnings of these levels, 0 = none", (2,)),
        Field(
            "undervoltage_mode",
            "u1",
            "",
            "parameter",
            "1 = undervoltage fault only while the power stage is on (VBUS.UVMODE)",
        ),
    ],
    state=[
        Field("voltage", "f8", "V", "firmware", "DC link (VBUS.VALUE)"),
    ],
)
