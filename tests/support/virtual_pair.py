"""A farm's table and a controller's table, joined by an ideal wire, one channel pair for each drive."""

from __future__ import annotations

import numpy as np
from bench_axis import MS, VELOCITY_STEP, configure
from plain_record import keep_rows, plain_rows

from pnfarm.engine.channels.schedule import ChannelTable, ConsumerPlan, ProviderPlan
from pnfarm.engine.columns import Columns, allocate
from pnfarm.engine.virtual import run_virtual
from pnfarm.table import engine_row
from pnfarm.table.compiling.compiled import IS_COMPILED
from pnfarm.table.program import CONSTANT
from pnfarm.table.signals import ITIST_GLATT, NIST_A, NSOLL_A, STW1, ZSW1, word_code

DRIVE_MAC = 0x02_00_00_00_00_00
CONTROLLER_MAC = 0x02_00_00_01_00_00
CONTROLLER_PORT = 1
#: Columns that an interpreted tick reads often: plain objects replace their rows while time passes.
ROWS = ("engine", "axis", "image", "program", "ppm", "cpm", "impairment")
EVENT_NAMES = {
    value: name.lower()
    for name, value in vars(engine_row).items()
    if name.isupper() and isinstance(value, int) and value < 20
}


class Pair:
    """``run`` virtual time; ``events`` lists (side, kind, row, value) since the start.

    Interpreted, the engine works on plain Python objects, which it reads thirty times as fast as records; the records
    have the same octets before and behind each ``run``.  With ``records`` it works on these, as under a debugger.
    """

    def __init__(
        self,
        drives: int = 1,
        *,
        factor: int = 32,
        ratio: int = 1,
        hold: int = 3,
        speed: float = 60.0,
        records: bool = IS_COMPILED,
    ) -> None:
        self.drives = drives
        self._records = records
        self.farm = allocate(images=drives, axes=drives, channels=drives * 2, impairments=drives * 4)
        self.controller = allocate(images=drives, programs=drives, channels=drives * 2)
        self.farm_channels = ChannelTable(self.farm)
        self.controller_channels = ChannelTable(self.controller)
        self.cycle_ns = factor * ratio * 31_250
        self.now = 1_000_000_000
        self.events: list[tuple[str, str, int, int]] = []
        self._tails = {"farm": 0, "controller": 0}
        for i in range(drives):
            drive = (DRIVE_MAC + i).to_bytes(6, "big")
            controller = CONTROLLER_MAC.to_bytes(6, "big")
            common = {"image": i, "data_length": 40, "send_clock_factor": factor, "reduction_ratio": ratio}
            configure(self.farm.axis[i])
            program = self.controller.program[i]
            program.active, program.kind, program.enable = 1, CONSTANT, 1
            program.speed, program.velocity_step, program.acknowledge_after_ns = speed, VELOCITY_STEP, 100 * MS
            self.farm_channels.open_provider(
                ProviderPlan(
                    port=i + 1, destination=controller, source=drive, frame_id=0x8000 + i, phase=i, iops=[9],
                    words=[(word_code(ZSW1), 3), (word_code(NIST_A), 5), (word_code(ITIST_GLATT), 7)],
                    constants=[(0, 0x80)], **common,
                )
            )  # fmt: skip
            self.farm_channels.open_consumer(
                ConsumerPlan(
                    port=i + 1, destination=drive, source=controller, frame_id=0xC000, data_hold_factor=hold, iops=[4],
                    words=[(word_code(STW1), 0), (word_code(NSOLL_A), 2)], **common,
                )
            )  # fmt: skip
            self.controller_channels.open_provider(
                ProviderPlan(
                    port=CONTROLLER_PORT, destination=drive, source=controller, frame_id=0xC000, iops=[4], phase=i,
                    words=[(word_code(STW1), 0), (word_code(NSOLL_A), 2)], **common,
                )
            )  # fmt: skip
            self.controller_channels.open_consumer(
                ConsumerPlan(
                    port=CONTROLLER_PORT, destination=controller, source=drive, frame_id=0x8000 + i,
                    data_hold_factor=hold, iops=[9],
                    words=[(word_code(ZSW1), 3), (word_code(NIST_A), 5), (word_code(ITIST_GLATT), 7)], **common,
                )
            )  # fmt: skip
        self.farm_addresses = np.arange(DRIVE_MAC, DRIVE_MAC + drives)
        self.farm_ports = np.arange(1, drives + 1, dtype=np.int32)
        self.controller_addresses = np.array([CONTROLLER_MAC])
        self.controller_ports = np.array([CONTROLLER_PORT], np.int32)

    def run(self, seconds: float) -> None:
        until = self.now + round(seconds * 1e9)
        if self._records:
            self._run(self.farm, self.controller, until)
            return
        stand_ins = [
            (columns, columns._replace(**{name: plain_rows(getattr(columns, name)) for name in ROWS}))
            for columns in (self.farm, self.controller)
        ]
        self._run(*(stand_in for _, stand_in in stand_ins), until)
        for columns, stand_in in stand_ins:
            for name in ROWS:
                keep_rows(getattr(stand_in, name), getattr(columns, name))

    def _run(self, farm: Columns, controller: Columns, until: int) -> None:
        while self.now < until:
            self.now = run_virtual(
                farm, controller, self.farm_addresses, self.farm_ports, self.controller_addresses,
                self.controller_ports, self.now, until,
            )  # fmt: skip
            self._drain("farm", farm)
            self._drain("controller", controller)

    def _drain(self, side: str, columns: Columns) -> None:
        head = int(columns.engine[0].event_head)
        for i in range(self._tails[side], head):
            event = columns.events[i % columns.events.shape[0]]
            self.events.append((side, EVENT_NAMES[int(event.kind)], int(event.row), int(event.value)))
        self._tails[side] = head

    def seen(self, kind: str, side: str = "farm") -> list[tuple[int, int]]:
        return [(row, value) for s, k, row, value in self.events if s == side and k == kind]
