"""Feeds parts to a clamp: axis-1 runs until the sensor reports a part, and stops with a lamp if none comes in time."""

from pnfarm import AxisProgram

OFF, READY, RUN = 0x0476, 0x0477, 0x047F
SPEED = 60.0


class Feeds(AxisProgram):
    longest = 2.0  # seconds to a part

    def __init__(self):
        self.feeding_since = None
        self.jammed = False

    def cycle(self, inputs, outputs, now):
        outputs.stw1, outputs.velocity = OFF, 0.0
        if self.name != "axis-1":
            return
        island = self.line.device("island")
        there = island.connected and island.inputs.good("part_present")
        part = there and island.inputs.part_present
        island.outputs.clamp = part
        if part:
            self.jammed = False
        island.outputs.jam_lamp = self.jammed
        if part or self.jammed or not there:
            self.feeding_since = None
            return
        if inputs.zsw1.operation_enabled:
            outputs.stw1, outputs.velocity = RUN, SPEED
            self.feeding_since = self.feeding_since or now
            self.jammed = (now - self.feeding_since) / 1e9 > self.longest
        elif inputs.zsw1.ready_to_operate:
            outputs.stw1 = RUN
        elif inputs.zsw1.ready_to_switch_on:
            outputs.stw1 = READY
