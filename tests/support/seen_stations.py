"""What a capture's decoder would have noted of connections, from a few facts."""

from ipaddress import IPv4Address
from uuid import UUID

from pnfarm.buses import registry
from pnfarm.buses.profinet.bus import PROFINET
from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan, PlannedSubmodule
from pnfarm.protocols.profinet.cm.controller.request import connect_payload
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand
from pnfarm.protocols.profinet.wire.cm.expected import DiffApi, DiffModule, ModuleDiffBlock
from pnfarm.protocols.profinet.wire.records.iod import IodWriteReqHeader, RecordWrite, WriteRequest
from pnfarm.protocols.profinet.wire.rpc.pdu import object_uuid

DEVICE = bytes.fromhex("020000000041")
PLC, SECOND = bytes.fromhex("020000000001"), bytes.fromhex("020000000002")
ADDRESS = IPv4Address("10.77.0.41")
#: (API, slot, module ident, subslot, submodule ident, octets in, octets out).
HEAD = ((0, 0, 0x77, 1, 0x78, 0, 0), (0, 0, 0x77, 0x8000, 0x80, 0, 0), (0, 0, 0x77, 0x8001, 0x81, 0, 0))
ISLAND = (*HEAD, (0, 1, 0x10, 1, 0x11, 2, 0), (0, 2, 0x20, 1, 0x21, 0, 1), (0, 3, 0x30, 1, 0x31, 4, 4))


class SeenPlant:
    """``connect`` and ``write``, then ``found``."""

    def __init__(self):
        self.decoder = registry.decoder().buses["profinet"]
        PROFINET.observe(self.decoder)
        self.observed = self.decoder.shared.observed

    def connect(self, places=ISLAND, plc=PLC, *, accepted=True, diff=(), device=DEVICE, change=None, **plan):
        """A Connect that was accepted; ``diff`` are modules that the device reports, of API 0."""
        asked = ArPlan(
            0xFF01, 7, 1, "plc-" + plc.hex()[-1], plc, UUID("dea00000-6c97-11d1-8271-00640101002a"),
            UUID(int=1 << 96 | int.from_bytes(plc)), 7, tuple(PlannedSubmodule(*place) for place in places), **plan,
        )  # fmt: skip
        request = parse_blocks(connect_payload(asked, *plan_frames(asked)))
        self.ask(tuple(map(change, request)) if change else request, plc, device)
        answer = (ModuleDiffBlock((DiffApi(0, tuple(diff)),)),) if diff else ()
        self.observed.answered(plc, device, answer if accepted else None)

    def ask(self, request, plc=PLC, device=DEVICE):
        self.observed.asked(request, plc, device, (object_uuid(1, 7, 0xFF01), ADDRESS), 10**18)

    def write(self, slot, index, data, *, subslot=1, plc=PLC, device=DEVICE, api=0, taken=True):
        header = IodWriteReqHeader(1, UUID(int=1), api, slot, subslot, index, len(data))
        self.observed.wrote(plc, device, WriteRequest(header, (RecordWrite(header, data),)))
        self.observed.refused(plc, device, () if taken else (header,))

    def end_parameters(self, plc=PLC, device=DEVICE):
        block = ControlBlock(0x0110, UUID(int=1), 7, ControlCommand.PRM_END)
        self.observed.controlled(plc, device, (block,))

    def found(self, **options):
        return list(PROFINET.found(self.decoder, **options))


def differing(slot, ident, state, *submodules):
    return DiffModule(slot, ident, state, submodules)
