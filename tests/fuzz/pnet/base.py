"""What a controller says to p-net's sample device, by the device's GSDML file: an AR of its own for each sequence."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any
from uuid import UUID

from pnfarm.buses.profinet.gsdml_file import load_gsdml
from pnfarm.protocols.profinet.cm.controller.frames import plan_frames
from pnfarm.protocols.profinet.cm.controller.plan import ArPlan
from pnfarm.protocols.profinet.cm.controller.request import connect_payload
from pnfarm.protocols.profinet.gsdml.planning import PlannedDevice, from_gsdml
from pnfarm.protocols.profinet.wire.any_block import parse_blocks
from pnfarm.protocols.profinet.wire.block import Block, BlockType
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock
from pnfarm.protocols.profinet.wire.cm.expected import ExpectedSubmoduleBlockReq
from pnfarm.protocols.profinet.wire.rpc.pdu import (
    UUID_PNIO_DEVICE,
    Flags1,
    Opnum,
    PacketType,
    RpcPdu,
    drep,
    emit_rpc,
    object_uuid,
)
from tests.support.ndr_counts import counted

__all__ = ["ADDRESS", "CONTROLLER", "MODULES", "NAME", "OWN", "Caller", "Sent", "planned"]

NAME, ADDRESS = "rt-labs-dev", "10.77.0.50"
#: The controller's MAC address and its own.
CONTROLLER, OWN = bytes.fromhex("020000000063"), "10.77.0.99"
MODULES = {1: "IDM_32", 2: "IDM_40"}
#: 64 ms, and 1.92 s without data: no cyclic frames are sent.
RATIO, HOLD = 64, 30
ROOM = 1300


@dataclass(frozen=True)
class Sent:
    """One message: what it is, its octets, and ``how`` it goes (:mod:`tests.interop.pnet_talk`).

    ``coarse``: of the answer only its kind is compared, as it is not known what is wrong with the message.
    """

    what: str
    octets: bytes
    how: str = "rpc"
    coarse: bool = False


def planned(gsdml: Path) -> PlannedDevice:
    """What the file says of the device."""
    return from_gsdml(load_gsdml(gsdml), modules=MODULES)


@dataclass
class Caller:
    """A controller: it numbers its calls, and has one AR."""

    rng: Random
    device: PlannedDevice
    sequence: int = 0
    activity: UUID = field(init=False)
    plan: ArPlan = field(init=False)

    def __post_init__(self) -> None:
        self.activity = UUID(bytes=self.rng.randbytes(16), version=4)
        self.plan = ArPlan(
            vendor_id=self.device.vendor_id, device_id=self.device.device_id, instance=self.device.instance,
            controller_name="plc", controller_mac=CONTROLLER, controller_object_uuid=object_uuid(1, 1, 0x2A),
            ar_uuid=UUID(bytes=self.rng.randbytes(16), version=4), session_key=self.rng.randrange(1, 0xFFFF),
            submodules=self.device.submodules, reduction_ratio=RATIO, watchdog_factor=HOLD,
        )  # fmt: skip

    def blocks(self) -> list[Block]:
        """Those of a good Connect, with one block for the submodules of all slots."""
        found = parse_blocks(connect_payload(self.plan, *plan_frames(self.plan)))
        slots = [api for block in found if isinstance(block, ExpectedSubmoduleBlockReq) for api in block.apis]
        rest = [block for block in found if not isinstance(block, ExpectedSubmoduleBlockReq)]
        return [*rest[:-1], ExpectedSubmoduleBlockReq(tuple(slots)), rest[-1]]

    def pdu(self, opnum: int, payload: bytes, args: dict[str, int] | None = None, **changes: Any) -> RpcPdu:
        """The next call; ``args`` are other counts of its arguments, ``changes`` other fields of its header."""
        little = changes.pop("little_endian", True)
        self.sequence += 1
        body = counted(ROOM, payload, little_endian=little, **(args or {}))
        return RpcPdu(
            **{
                "packet_type": PacketType.REQUEST,
                "interface": UUID_PNIO_DEVICE,
                "activity": self.activity,
                "object_uuid": self.plan.device_object_uuid,
                "sequence": self.sequence,
                "opnum": opnum,
                "body": body,
                "flags1": Flags1.IDEMPOTENT | Flags1.NO_FACK,
                "drep": drep(little_endian=little),
                **changes,
            }
        )

    def call(self, what: str, opnum: int, payload: bytes, args: dict[str, int] | None = None, **changes: Any) -> Sent:
        return Sent(what, emit_rpc(self.pdu(opnum, payload, args, **changes)))

    def connect(self, what: str = "a Connect") -> Sent:
        return self.call(what, Opnum.CONNECT, b"".join(block.emit() for block in self.blocks()))

    def control(self, block_type: int, order: int, /, **changes: Any) -> bytes:
        """The one block of a Control or a Release."""
        block = ControlBlock(block_type, self.plan.ar_uuid, self.plan.session_key, order)
        return replace(block, **changes).emit()

    def release(self, what: str) -> Sent:
        return self.call(what, Opnum.RELEASE, self.control(BlockType.RELEASE_REQ, 4))
