"""Slaves of a capture as drives of a farm file: the ident number determines the model of each.

Everything else is listed with what was seen of it.  A telegram is no key of a drive: its master's Chk_Cfg chooses it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pnfarm.buses.imports import Found, FoundDrive, FoundStation, Said, drives_first
from pnfarm.buses.profibus.config.drive import HIGHEST_ADDRESS
from pnfarm.buses.profibus.decode.names import (
    configuration_text,
    diagnosis_text,
    model_by_ident,
    models_with_identifiers,
    parameters_text,
)
from pnfarm.vocabulary.durations import format_duration

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pnfarm.buses.profibus.decode.decoder import ProfibusDecoder
    from pnfarm.buses.profibus.decode.observed import SeenSlave
    from pnfarm.drives.description.model import Model

__all__ = ["LINE", "found", "said_of"]

#: Name of the line in a farm file.
LINE = "profibus"
_US = 1_000


def found(decoder: ProfibusDecoder, *, models: bool = True) -> Iterator[Found]:
    """Drives first, then other slaves."""
    observed = decoder.shared.observed
    slaves = [] if observed is None else observed.slaves
    return drives_first(_station(seen, decoder.polled_ns(seen.address), models=models) for seen in slaves)


def _station(seen: SeenSlave, cycle_ns: int, *, models: bool) -> FoundDrive | FoundStation:
    known = model_by_ident(seen.ident) if models and seen.ident is not None else None
    facts = tuple(_facts(seen, known, cycle_ns))
    keys: dict[str, Any] = {"address": seen.address} if seen.address <= HIGHEST_ADDRESS else {}
    said = said_of("", seen.ident, seen.identifiers)
    if known is None:
        return FoundStation(f"station {seen.address}", (*facts, *_like(seen)), LINE, keys=keys, said=said)
    notes: list[str] = []
    if not keys:
        notes.append(f"it had address {seen.address}, the default of a slave without an address")
    return FoundDrive(f"drive-{seen.address}", known.name, keys, tuple(notes), facts, LINE, said=said)


def said_of(name: str, ident: int | None = None, identifiers: bytes | None = None) -> Said:
    """What a capture or a project says of a slave, in words that are the same; ``identifiers`` are those of Chk_Cfg."""
    return Said(
        name=name,
        identity={} if ident is None else {"ident number": f"0x{ident:04X}"},
        # empty slots after the last module may be named or not
        subjects={} if identifiers is None else {"configuration": identifiers.rstrip(b"\0").hex(" ")},
    )


def _facts(seen: SeenSlave, known: Model | None, cycle_ns: int) -> Iterator[str]:
    ident, parameters = seen.ident, seen.parameters
    yield f"address {seen.address}, " + ("its ident number was not seen" if ident is None else f"ident 0x{ident:04X}")
    for what, number in (("parameters", seen.parametrisations), ("configurations", seen.configurations)):
        if number > 1:
            yield f"its masters sent {number} different {what}, one after the other: the last count"
    if parameters is not None:
        yield f"Set_Prm by master {seen.master}: {parameters_text(parameters)}"
        if parameters.ident != ident:
            yield f"its master takes it for one with ident 0x{parameters.ident:04X}"
    if seen.identifiers is not None:
        yield f"configuration: {configuration_text(seen.identifiers, known)}"
    if cycle_ns:
        # to the microsecond: it is a mean
        yield f"polled every {format_duration(max(1, round(cycle_ns / _US)) * _US)}"
    if seen.diagnosis is not None:
        yield f"last diagnosis: {diagnosis_text(seen.diagnosis)}"


def _like(seen: SeenSlave) -> Iterator[str]:
    """Models with another ident number that this master could configure in the same way."""
    if seen.identifiers is None or seen.ident is None:
        return
    for model, telegram in models_with_identifiers(seen.identifiers):
        yield (
            f"telegram {telegram} of {model} has the same identifiers: {{model: {model}, "
            f"identity: {{device: 0x{seen.ident:04X}}}}} would replace it if it is one"
        )
