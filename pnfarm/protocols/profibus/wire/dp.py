"""Data of DP-V0: diagnosis, parameters, configuration, global control, address.

EN 50170 part 2, 8.3; the octets of DPV1 in Set_Prm: guideline 2.082.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Final

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.sized import Sized
from pnfarm.wire.layout import Fixed, Rest, UInt8, UInt16

__all__ = [
    "HEAD_OCTETS", "MOST_DIAGNOSIS", "NO_MASTER", "Control", "Diagnosis", "DiagnosisBlock", "DpState", "GlobalControl",
    "Identifier", "Parameters", "PrmStatus", "SetAddress", "StationStatus", "V1Status1", "V1Status2", "V1Status3",
    "join_diagnoses", "parse_identifiers", "watchdog_factors",
]  # fmt: skip

#: Master address of a slave that none has parametrised.
NO_MASTER: Final = 0xFF
#: Longest diagnosis.
MOST_DIAGNOSIS: Final = 244
#: Those that each diagnosis has.
HEAD_OCTETS: Final = 6

# -- Slave_Diag (8.3.1) -----------------------------------------------------------------------------------------------


class StationStatus(IntEnum):
    """Octets 1 to 3 of a diagnosis, the first one lowest."""

    STATION_NON_EXISTENT = 0x000001
    STATION_NOT_READY = 0x000002
    CFG_FAULT = 0x000004
    EXT_DIAG = 0x000008
    NOT_SUPPORTED = 0x000010
    INVALID_SLAVE_RESPONSE = 0x000020
    PRM_FAULT = 0x000040
    MASTER_LOCK = 0x000080
    PRM_REQ = 0x000100
    STAT_DIAG = 0x000200
    ALWAYS_1 = 0x000400
    WD_ON = 0x000800
    FREEZE_MODE = 0x001000
    SYNC_MODE = 0x002000
    DEACTIVATED = 0x008000
    EXT_DIAG_OVERFLOW = 0x800000


@dataclass(frozen=True, slots=True)
class DiagnosisBlock:
    """A block of the extended diagnosis: its first octet says of which kind it is and, but for channels, its length."""

    octets: bytes

    @property
    def kind(self) -> str:
        """``device`` (with DP-V1: alarm, status), ``identifier``, ``channel`` or ``revision``."""
        return ("device", "identifier", "channel", "revision")[self.octets[0] >> 6]


def _status_octets(status: int) -> bytes:
    return status.to_bytes(3, "little")


class Diagnosis(Sized, sizes=range(6, MOST_DIAGNOSIS + 1), text="a diagnosis of {} octets"):
    """``extended``: octets after the first six, blocks one after the other."""

    status: Annotated[int, Fixed("3s", lambda octets: int.from_bytes(octets, "little"), _status_octets)]
    master: UInt8
    ident: UInt16
    extended: Rest = b""

    def blocks(self) -> list[DiagnosisBlock]:
        """The blocks of the extended part; what is cut off ends the list."""
        return _blocks(self.extended)


def _blocks(extended: bytes) -> list[DiagnosisBlock]:
    found: list[DiagnosisBlock] = []
    place = 0
    while place < len(extended):
        head = extended[place]
        length = {2: 3, 3: 1}.get(head >> 6, head & 0x3F)
        if length == 0 or place + length > len(extended):
            break
        found.append(DiagnosisBlock(extended[place : place + length]))
        place += length
    return found


def join_diagnoses(several: Iterable[bytes], most: int) -> bytes:
    """One extended part of several, oldest first: all bits of identifiers, every channel, the device's latest block.

    What makes it longer than ``most`` octets is left out, the newest first.
    """
    device, identifiers, others = b"", b"", dict[bytes, None]()
    for block in (block for extended in several for block in _blocks(extended)):
        match block.kind:
            case "device":
                device = block.octets
            case "identifier":
                # the head counts the octets: of the longer one it is the right one
                longer, shorter = sorted((identifiers, block.octets), key=len, reverse=True)
                bits = int.from_bytes(longer[1:], "little") | int.from_bytes(shorter[1:], "little")
                identifiers = longer[:1] + bits.to_bytes(len(longer) - 1, "little")
            case _:
                others[block.octets] = None
    joined = b""
    for octets in (device, identifiers, *others):
        if len(joined) + len(octets) <= most:
            joined += octets
    return joined


def diagnosis_octets(status: int, master: int, ident: int, extended: bytes) -> bytes:
    """Those of a :class:`Diagnosis` for a slave, whose answer is due at once."""
    return _status_octets(status) + bytes((master,)) + ident.to_bytes(2, "big") + extended


# -- Set_Prm (8.3.3) --------------------------------------------------------------------------------------------------


class PrmStatus(IntEnum):
    """Octet 1."""

    WD_ON = 0x08
    FREEZE_REQ = 0x10
    SYNC_REQ = 0x20
    UNLOCK_REQ = 0x40
    LOCK_REQ = 0x80


class V1Status1(IntEnum):
    """DPV1_Status_1: octet 8."""

    WD_BASE_1MS = 0x04
    PUBLISHER = 0x20
    FAIL_SAFE = 0x40
    DPV1_ENABLE = 0x80


class V1Status2(IntEnum):
    """DPV1_Status_2: octet 9."""

    CHECK_CFG_MODE = 0x01
    UPDATE_ALARM = 0x04
    STATUS_ALARM = 0x08
    MANUFACTURER_ALARM = 0x10
    DIAGNOSTIC_ALARM = 0x20
    PROCESS_ALARM = 0x40
    PULL_PLUG_ALARM = 0x80


class V1Status3(IntEnum):
    """DPV1_Status_3: octet 10."""

    PRM_CMD = 0x08
    ISOCHRONOUS = 0x10


class Parameters(Sized, sizes=range(7, 245), text="Set_Prm of {} octets"):
    """``user``: the data after the first seven octets, the three octets of DPV1 first where the slave has them.

    ``factors``: of the watchdog; ``min_tsdr``: bits, 0 to leave it as it is.
    """

    status: UInt8
    factors: tuple[UInt8, UInt8]
    min_tsdr: UInt8
    ident: UInt16
    group: UInt8 = 0
    user: Rest = b""

    @property
    def v1(self) -> tuple[int, int, int]:
        """DPV1_Status_1 to 3; zero where they are missing."""
        one, two, three = (self.user[:3] + bytes(3))[:3]
        return one, two, three

    def watchdog_ns(self, *, v1: bool = True) -> int:
        """Time of the watchdog; 0 without one.  ``v1``: the slave has DP-V1, so that its octets say the base."""
        if not self.status & PrmStatus.WD_ON:
            return 0
        base = 1_000_000 if v1 and self.v1[0] & V1Status1.WD_BASE_1MS else 10_000_000
        return self.factors[0] * self.factors[1] * base


def watchdog_factors(time_ns: int, base_ns: int = 10_000_000) -> tuple[int, int]:
    """The two factors whose product is the least that reaches this time, with the smaller one first.

    Raises :class:`ValueError` for a time beyond them.
    """
    steps = max(1, -(-time_ns // base_ns))
    found: tuple[int, int, int] | None = None
    for first in range(1, 256):
        second = -(-steps // first)
        if second <= 255 and first <= second and (found is None or first * second < found[0]):
            found = first * second, first, second
    if found is None:
        raise ValueError(f"{time_ns} ns are more than 255 x 255 x {base_ns} ns")
    return found[1], found[2]


# -- Chk_Cfg and Get_Cfg (8.3.5) --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Identifier:
    """One identifier with its octets; ``inputs`` and ``outputs`` are octets of data, as a master names them."""

    octets: bytes
    inputs: int
    outputs: int
    #: Whether the data are consistent as a whole, not just each unit of them.
    consistent: bool
    #: Octets after the length octets of a special format.
    specific: bytes = b""
    #: Whether the unit of the data is a word.
    input_words: bool = False
    output_words: bool = False


def parse_identifiers(data: bytes) -> list[Identifier]:
    """Raises :class:`DecodeError`."""
    found: list[Identifier] = []
    place = 0
    while place < len(data):
        head = data[place]
        if head & 0x30:
            length = (head & 0x0F) + 1
            length *= 2 if head & 0x40 else 1
            kind, words = head >> 4 & 3, bool(head & 0x40)
            inputs, outputs = length if kind & 1 else 0, length if kind & 2 else 0
            found.append(Identifier(bytes((head,)), inputs, outputs, bool(head & 0x80), b"", words, words))
            place += 1
            continue
        end = place + 1
        sizes = {"outputs": 0, "inputs": 0}
        in_words = {"outputs": False, "inputs": False}
        consistent = True
        for bit, name in ((0x80, "outputs"), (0x40, "inputs")):
            if head & bit:
                if end >= len(data):
                    raise DecodeError("short", "a length octet of an identifier is missing")
                octet = data[end]
                in_words[name] = bool(octet & 0x40)
                sizes[name] = ((octet & 0x3F) + 1) * (2 if in_words[name] else 1)
                consistent = consistent and bool(octet & 0x80)
                end += 1
        specific = head & 0x0F
        if specific == 15:
            specific = 0
        if end + specific > len(data):
            raise DecodeError("short", "manufacturer specific octets of an identifier are missing")
        found.append(
            Identifier(
                data[place : end + specific],
                sizes["inputs"],
                sizes["outputs"],
                consistent,
                data[end : end + specific],
                in_words["inputs"],
                in_words["outputs"],
            )
        )
        place = end + specific
    return found


# -- Global_Control (8.3.7) -------------------------------------------------------------------------------------------


class Control(IntEnum):
    """Control_Command."""

    CLEAR_DATA = 0x02
    UNFREEZE = 0x04
    FREEZE = 0x08
    UNSYNC = 0x10
    SYNC = 0x20


class GlobalControl(Sized, sizes=range(2, 3), text="Global_Control of {} octets"):
    """``groups``: 0 for all slaves, else a bit for each of eight groups."""

    command: UInt8
    groups: UInt8 = 0


# -- Set_Slave_Add (8.3.8) --------------------------------------------------------------------------------------------


class SetAddress(Sized, sizes=range(4, 1 << 16), text="Set_Slave_Add of {} octets", reason="short"):
    """``locks``: no other change of the address afterwards (No_Add_Chg)."""

    address: UInt8
    ident: UInt16
    locks: Annotated[bool, Fixed("B", bool, lambda locks: 0xFF * bool(locks))] = False
    remanent: Rest = b""


class DpState(IntEnum):
    """States of a slave (8.2)."""

    POWER_ON = 0
    WAIT_PRM = 1
    WAIT_CFG = 2
    DATA_EXCH = 3
