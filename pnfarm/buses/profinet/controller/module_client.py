"""The modules in the slots of any device on the network: the records to read, one after the other, and their decoding.

The device's APIs come from APIData, their modules from RealIdentificationData of each API; both are read without a
connection (ReadImplicit), so that no connection is disturbed.  Of a device that does not report its APIs, API 0, which
every device has, and PROFIdrive's are read.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pnfarm.errors import DecodeError, RemoteError
from pnfarm.protocols.profinet.records.directory import Index
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.records.identification import ApiData, IdentificationData

if TYPE_CHECKING:
    from collections.abc import Generator

    from pnfarm.buses.profinet.controller.record_client import RecordClient
    from pnfarm.buses.profinet.controller.records import RecordPlace

__all__ = ["DeviceModule", "DeviceSubmodule", "read_modules"]

#: For a device that does not report its APIs.
_USUAL_APIS = (0, 0x3A00)
#: APIs that are asked for; a device has a handful.
_MOST_APIS = 64


@dataclass(frozen=True, slots=True)
class DeviceSubmodule:
    """One submodule as the device has it."""

    subslot: int
    ident: int
    api: int


@dataclass(slots=True)
class DeviceModule:
    """One slot; its submodules may belong to several APIs."""

    slot: int
    ident: int
    submodules: list[DeviceSubmodule] = field(default_factory=list)


def read_modules() -> Generator[RecordPlace, RecordClient, tuple[DeviceModule, ...]]:
    """Generator: yields the next record to read, is sent the client that read it, returns the modules by slot.

    Raises :class:`RemoteError` where no API can be read, or an answer is malformed.
    """
    client = yield (0, 0, 0, Index.API_DATA)
    apis = _apis(client)
    told = apis is not None
    modules: dict[int, DeviceModule] = {}
    failure: RemoteError | None = None
    for api in apis if apis is not None else _USUAL_APIS:
        client = yield (api, 0, 0, Index.REAL_IDENTIFICATION_API)
        try:
            client.check()
        except RemoteError as exc:
            # an API that was only assumed may not exist
            if told or api == 0:
                failure = failure or exc
            continue
        _take(modules, api, client.data or b"")
    if failure is not None and not modules:
        raise failure
    for module in modules.values():
        module.submodules.sort(key=lambda s: (s.subslot, s.api))
    return tuple(modules[slot] for slot in sorted(modules))


def _apis(client: RecordClient) -> tuple[int, ...] | None:
    """The device's APIs, or None where it does not report them."""
    if client.data is None:
        return None
    for block in _blocks(client.data, "APIData"):
        if isinstance(block, ApiData):
            return tuple(dict.fromkeys(block.apis))[:_MOST_APIS]
    return None


def _take(modules: dict[int, DeviceModule], api: int, data: bytes) -> None:
    for block in _blocks(data, "RealIdentificationData"):
        if not isinstance(block, IdentificationData):
            continue
        for part in block.apis:
            for slot in part.slots:
                module = modules.setdefault(slot.slot, DeviceModule(slot.slot, slot.module_ident))
                # an answer in the older form names no API
                own = part.api or api
                module.submodules += [DeviceSubmodule(subslot, ident, own) for subslot, ident in slot.submodules]


def _blocks(data: bytes, name: str) -> tuple[object, ...]:
    try:
        return parse_blocks(data)
    except DecodeError as exc:
        raise RemoteError(f"{name} is malformed ({exc})") from exc
