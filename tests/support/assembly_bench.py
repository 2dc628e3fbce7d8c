"""An AKD on EtherNet/IP on the bench: command assemblies in, response assemblies out, its axis looked at."""

from __future__ import annotations

from collections.abc import Mapping
from struct import pack, unpack_from
from typing import Any

import numpy as np
from plain_record import octets, plain
from stepping import run_steps

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model
from pnfarm.drives.description.behaviour import with_behaviour
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.firmware.axis import AXIS
from pnfarm.firmware.step import step
from pnfarm.table.axis_codes import CMD_POWER_ON
from pnfarm.table.compiling.compiled import IS_COMPILED
from pnfarm.table.image import IMAGE, LOST_NEVER, LOST_NOT
from pnfarm.table.signals import ASSEMBLY, ASSEMBLY_WORDS

MS = 1_000_000
#: Position units and profile units of a revolution, and of one in a second, as they come.
REVOLUTION = 65536

ENABLE = 0x80
HARD_STOP = 0x20
SMOOTH_STOP = 0x10
FORWARDS = 0x08
RELATIVE = 0x04
START_BLOCK = 0x02
LOAD = 0x01

TORQUE, MOVE, JOG, SET_ATTRIBUTE, PARAMETER = 0x05, 0x06, 0x07, 0x1B, 0x1F
POSITION, VELOCITY, TORQUE_MODE = 2, 1, 0


def command(
    word: int,
    kind: int = 0,
    *,
    block: int = 0,
    response: int = 0,
    data: int = 0,
    position: int = 0,
    velocity: int = 0,
    up: int = 0,
    down: int = 0,
    value: int = 0,
    attribute: int = 0,
    map_type: int = 0,
    dynamic: bytes = b"",
) -> bytes:
    """A command assembly of 64 octets for axis 1."""
    head = pack(
        "<BBBBi4iqBBH",
        word, block, 0x20 | kind, 0x20 | response, data, position, velocity, up, down, value, attribute, map_type, 0,
    )  # fmt: skip
    return (head + dynamic).ljust(64, b"\0")


class AssemblyBench:
    """``send`` a command as a controller does, ``run`` time, read the response."""

    def __init__(self, mode: int = POSITION, *, homed: bool = True, behaviour: Mapping[str, str] | None = None) -> None:
        self.axes, self.images = AXIS.allocate(1), IMAGE.allocate(1)
        self.axis: Any = self.axes[0]
        self.image: Any = self.images[0]
        described = with_behaviour(model("akd-ethernetip"), behaviour or {})
        described.apply_motor(self.axis)
        self.axis.front = described.front
        self.axis.powered = 1
        self.axis.step_ns = MS
        self.store = ParameterStore(described, AxisHandle(self.axis, self.image))
        self.store.power_on()
        self.store.set("DRV.OPMODE", mode)
        self.image.lost = LOST_NEVER
        self.now = 0
        self.store.handle.push_command(CMD_POWER_ON)
        self.run(150)
        if homed:
            self.axis.homing.homed = 1

    def run(self, milliseconds: int = 1) -> None:
        if IS_COMPILED:
            self.now = run_steps(self.axes, self.images, self.now, MS, milliseconds)
            return
        # plain objects, because the interpreter reads records slowly
        axis, image = plain(self.axis), plain(self.image)
        for _ in range(milliseconds):
            self.now += MS
            step(axis, image, self.now)
        for rows, stand_in in ((self.axes, axis), (self.images, image)):
            rows.view(np.uint8)[:] = np.frombuffer(octets(stand_in, rows.dtype), np.uint8)

    def send(self, assembly: bytes, milliseconds: int = 1) -> bytes:
        """A command is received and stays; the response behind so many milliseconds."""
        self.image.received[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS] = np.frombuffer(assembly.ljust(64, b"\0"), "<i4")
        self.image.valid, self.image.lost = 1, LOST_NOT
        self.run(milliseconds)
        return self.response

    def lose(self, why: int, milliseconds: int = 1) -> bytes:
        self.image.valid, self.image.lost = 0, why
        self.run(milliseconds)
        return self.response

    def enable(self, milliseconds: int = 10) -> bytes:
        self.send(command(0))
        return self.send(command(ENABLE), milliseconds)

    @property
    def response(self) -> bytes:
        return self.image.sent[ASSEMBLY : ASSEMBLY + ASSEMBLY_WORDS].astype("<i4").tobytes()

    @property
    def first(self) -> int:
        return self.response[0]

    @property
    def second(self) -> int:
        return self.response[2]

    def signed(self, octet: int) -> int:
        return int(unpack_from("<i", self.response, octet)[0])

    def long(self, octet: int) -> int:
        return int(unpack_from("<q", self.response, octet)[0])

    @property
    def error(self) -> tuple[int, int]:
        """Code and additional code; (0, 0) where the response is none of type 0x14."""
        return (self.response[4], self.response[5]) if self.response[3] & 0x1F == 0x14 else (0, 0)

    def load(self, word: int, kind: int, milliseconds: int = 1, **fields: Any) -> bytes:
        """Load/Start rises: first low, then high."""
        self.send(command(word, kind, **fields))
        return self.send(command(word | LOAD, kind, **fields), milliseconds)
