"""Connect requests that differ from the captured one in a single field or block, and a device for each captured one."""

from dataclasses import replace

from cm_support import DRIVE, Plan, connect_request

from pnfarm.protocols.profinet.description import (
    DeviceDescription,
    Limits,
    ModuleDescription,
    SubmoduleDescription,
)
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import split_blocks
from pnfarm.protocols.profinet.wire.cm.expected import (
    ExpectedSubmoduleBlockReq,
)

P = Plan()


def ar(**fields):
    return replace(P, ar=replace(P.ar, **fields))


def iocr(**fields):
    return replace(P, inputs=replace(P.inputs, **fields))


def alarm(**fields):
    return replace(P, alarm=replace(P.alarm, **fields))


def drive(**fields):
    return replace(P, drive=replace(P.drive, **fields))


def telegram_sub(**fields):
    return drive(submodules=(P.drive.submodules[0], replace(P.drive.submodules[1], **fields)))


def pap(**fields):
    return drive(submodules=(replace(P.drive.submodules[0], **fields), P.drive.submodules[1]))


def data(**fields):
    first, second = P.drive.submodules[1].data
    return telegram_sub(data=(replace(first, **fields), second))


def with_blocks(*blocks):
    return replace(P, blocks=blocks)


def versioned(position, version):
    """The request with one block's version changed."""
    raws = list(split_blocks(P.payload()))
    raws[position] = replace(raws[position], version=version)
    return with_blocks(*raws)


def cut(position):
    raws = list(split_blocks(P.payload()))
    raws[position] = replace(raws[position], body=raws[position].body[:-1])
    return with_blocks(*raws)


def moved(subslot):
    """The parameter access point in another subslot, also in both frames."""

    def shift(cr):
        def slots(entries):
            return tuple(replace(e, subslot=subslot) if (e.slot, e.subslot) == (1, 1) else e for e in entries)

        apis = tuple(replace(a, data_objects=slots(a.data_objects), iocs=slots(a.iocs)) for a in cr.apis)
        return replace(cr, apis=apis)

    return replace(pap(subslot=subslot), inputs=shift(P.inputs), outputs=shift(P.outputs))


BASE = parse_blocks(P.payload())
DA = replace(P.ar, ar_type=6, properties=0x111)


def fitting(name):
    """A device that has what a captured request expects."""
    blocks = parse_blocks(connect_request(name))
    apis = [a for b in blocks if isinstance(b, ExpectedSubmoduleBlockReq) for a in b.apis]
    modules = tuple(
        ModuleDescription(
            a.slot,
            a.module_ident,
            tuple(
                SubmoduleDescription(
                    a.slot, s.subslot, a.api, a.module_ident, s.submodule_ident, s.length(1), s.length(2)
                )
                for s in a.submodules
            ),
        )
        for a in apis
    )
    return DeviceDescription(
        1, 1, "test", modules[0], DRIVE.im0, modules[1:], min_device_interval=8, limits=Limits(strict=False)
    )
