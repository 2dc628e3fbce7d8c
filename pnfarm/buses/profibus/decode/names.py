"""The data of DP-V0's services and the identity of a slave, as text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.buses.decoding.identity import models_by
from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.wire.dp import (
    NO_MASTER,
    Control,
    Diagnosis,
    GlobalControl,
    Parameters,
    PrmStatus,
    SetAddress,
    StationStatus,
    V1Status1,
    V1Status2,
    parse_identifiers,
)

if TYPE_CHECKING:
    from enum import IntEnum

    from pnfarm.drives.description.model import Model

__all__ = [
    "address_text", "configuration_text", "control_text", "diagnosis_text", "model_by_ident", "models_with_identifiers",
    "parameters_text",
]  # fmt: skip


def _ident(model: Model) -> int:
    return model.profidrive.identity.device_id


def model_by_ident(ident: int) -> Model | None:
    """The model with this ident number, as the catalogue has it."""
    return models_by("profibus", _ident).get(ident)


def models_with_identifiers(identifiers: bytes) -> list[tuple[str, int]]:
    """Models and numbers of their telegrams that Chk_Cfg chooses with these."""
    return [
        (one.name, telegram.number)
        for one in models_by("profibus", _ident).values()
        for telegram in one.profidrive.telegrams.values()
        if telegram.identifiers and telegram.identifiers == identifiers
    ]


def _flags(value: int, bits: type[IntEnum]) -> list[str]:
    return [bit.name.lower().replace("_", " ") for bit in bits if value & bit]


def diagnosis_text(diagnosis: Diagnosis) -> str:
    """Status bits, master, ident number, and the extended octets by blocks."""
    bits = _flags(diagnosis.status & ~StationStatus.ALWAYS_1, StationStatus) or ["nothing to report"]
    master = "no master" if diagnosis.master == NO_MASTER else f"master {diagnosis.master}"
    parts = [", ".join(bits), master, f"ident 0x{diagnosis.ident:04X}"]
    if not diagnosis.status & StationStatus.ALWAYS_1:
        parts.append("the bit that is always set is not")
    parts += [f"{block.kind} {block.octets.hex(' ')}" for block in diagnosis.blocks()]
    rest = len(diagnosis.extended) - sum(len(block.octets) for block in diagnosis.blocks())
    if rest:
        parts.append(f"{rest} octets that are no block")
    return "; ".join(parts)


def parameters_text(parameters: Parameters) -> str:
    """What a Set_Prm asks for."""
    bits = [bit for bit in _flags(parameters.status, PrmStatus) if bit != "wd on"]
    watchdog = parameters.watchdog_ns()
    parts = [
        ", ".join(bits) or "neither lock nor unlock",
        f"watchdog {watchdog / 1e6:g} ms" if watchdog else "no watchdog",
        f"min T_SDR {parameters.min_tsdr} bits" if parameters.min_tsdr else "min T_SDR unchanged",
        f"ident 0x{parameters.ident:04X}",
    ]
    if parameters.group:
        parts.append(f"groups 0x{parameters.group:02X}")
    if parameters.user:
        one, two, _ = parameters.v1
        enabled = [*_flags(one, V1Status1), *_flags(two, V1Status2)]
        parts.append(f"user {parameters.user.hex(' ')}" + (f" ({', '.join(enabled)})" if enabled else ""))
    return "; ".join(parts)


def configuration_text(identifiers: bytes, described: Model | None) -> str:
    """Identifiers, their octets, and the drive's telegram with them."""
    telegram = None
    if described is not None:
        known = described.profidrive.telegrams.values()
        telegram = next((one for one in known if one.identifiers == identifiers), None)
    try:
        parts = parse_identifiers(identifiers)
    except DecodeError as exc:
        return f"{identifiers.hex(' ')}: {exc}"
    outputs, inputs = sum(part.outputs for part in parts), sum(part.inputs for part in parts)
    named = f"telegram {telegram.number}, " if telegram is not None else ""
    return f"{named}{outputs} octets of outputs, {inputs} of inputs ({identifiers.hex(' ')})"


def control_text(control: GlobalControl) -> str:
    """Commands, and for whom."""
    words = _flags(control.command, Control)
    whom = f"groups 0x{control.groups:02X}" if control.groups else "all slaves"
    return f"{', '.join(words) or 'operate'}; {whom}"


def address_text(wanted: SetAddress) -> str:
    """The new address."""
    locked = ", locked" if wanted.locks else ""
    return f"address {wanted.address}{locked}; ident 0x{wanted.ident:04X}"


def is_set_up(parameters: Parameters) -> bool:
    """Whether a Set_Prm takes the slave rather than releasing it."""
    return bool(parameters.status & PrmStatus.LOCK_REQ) and not parameters.status & PrmStatus.UNLOCK_REQ
