"""Writing a GSD file: the description of a slave that engineering tools import (GSD revision 5).

Lines end with CR LF, the text is ASCII, numbers are written as tools write them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.protocols.profibus.gsd.statements import INTERVAL_NS, RATES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["GsdModule", "SlaveDescription", "emit_gsd"]


@dataclass(frozen=True, slots=True)
class GsdModule:
    """One choice of identifiers; ``number`` is its Module_Reference."""

    name: str
    identifiers: bytes
    number: int
    info: str = ""


@dataclass(frozen=True, slots=True)
class SlaveDescription:
    """What a slave says of itself; times in bits of the line, lengths in octets.

    ``rates``: baud rate and longest Tsdr.  ``interval_ns``: least time between two polls, ns, rounded up to 100 us.
    ``diagnosis``: most octets of a diagnosis, with the first six.  ``channel_errors``: error of a channel -> its text.
    """

    vendor: str
    model: str
    revision: str
    ident: int
    hardware: str
    software: str
    family: int
    rates: Sequence[tuple[int, int]]
    interval_ns: int
    freeze: bool
    sync: bool
    fail_safe: bool
    address_changes: bool
    auto_baud: bool
    modules: Sequence[GsdModule]
    longest: int
    diagnosis: int
    parameters: bytes
    v1: bool
    longest_record: int
    connections: int
    comments: Sequence[str] = ()
    channel_errors: Mapping[int, str] = field(default_factory=dict)


def _text(value: str) -> str:
    return '"' + value.encode("ascii", "replace").decode("ascii").replace('"', "'") + '"'


def _octets(value: bytes) -> str:
    return ",".join(f"0x{octet:02X}" for octet in value)


def emit_gsd(slave: SlaveDescription) -> bytes:
    """The file."""
    flags = {True: 1, False: 0}
    lines: list[str] = [f"; {comment}" for comment in slave.comments]
    lines += [
        "#Profibus_DP",
        "GSD_Revision = 5",
        f"Vendor_Name = {_text(slave.vendor)}",
        f"Model_Name = {_text(slave.model)}",
        f"Revision = {_text(slave.revision)}",
        f"Ident_Number = 0x{slave.ident:04X}",
        "Protocol_Ident = 0",
        "Station_Type = 0",
        "FMS_supp = 0",
        f"Hardware_Release = {_text(slave.hardware)}",
        f"Software_Release = {_text(slave.software)}",
    ]
    lines += [f"{RATES[rate]}_supp = 1" for rate, _ in slave.rates]
    lines += [f"MaxTsdr_{RATES[rate]} = {tsdr}" for rate, tsdr in slave.rates]
    lines += [
        "Redundancy = 0",
        "Repeater_Ctrl_Sig = 2",
        "24V_Pins = 0",
        f"Freeze_Mode_supp = {flags[slave.freeze]}",
        f"Sync_Mode_supp = {flags[slave.sync]}",
        f"Auto_Baud_supp = {flags[slave.auto_baud]}",
        f"Set_Slave_Add_supp = {flags[slave.address_changes]}",
        f"Fail_Safe = {flags[slave.fail_safe]}",
        f"Min_Slave_Intervall = {-(-slave.interval_ns // INTERVAL_NS)}",
        f"Slave_Family = {slave.family}",
        f"Max_Diag_Data_Len = {slave.diagnosis}",
        "Modular_Station = 1",
        "Max_Module = 1",
        f"Max_Input_Len = {slave.longest}",
        f"Max_Output_Len = {slave.longest}",
        f"Max_Data_Len = {2 * slave.longest}",
        "Modul_Offset = 1",
    ]
    if slave.v1:
        lines += [
            "DPV1_Slave = 1",
            "C1_Read_Write_supp = 1",
            f"C1_Max_Data_Len = {slave.longest_record}",
            "C1_Response_Timeout = 100",
            "C2_Read_Write_supp = 1",
            f"C2_Max_Data_Len = {slave.longest_record}",
            "C2_Response_Timeout = 100",
            f"C2_Max_Count_Channels = {slave.connections}",
            "Max_Initiate_PDU_Length = 52",
            "WD_Base_1ms_supp = 1",
        ]
    lines += [
        f"Max_User_Prm_Data_Len = {len(slave.parameters)}",
        f"Ext_User_Prm_Data_Const(0) = {_octets(slave.parameters)}",
    ]
    lines += [f"Channel_Diag({error}) = {_text(text)}" for error, text in sorted(slave.channel_errors.items())]
    for module in slave.modules:
        lines += [f"Module = {_text(module.name)} {_octets(module.identifiers)}", str(module.number)]
        if module.info:
            lines.append(f"Info_Text = {_text(module.info)}")
        lines.append("EndModule")
    return "".join(f"{line}\r\n" for line in lines).encode("ascii", "replace")
