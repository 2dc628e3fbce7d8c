"""Wrong on purpose: feeds until the sensor reports a part, however long that takes."""

from pnfarm import AxisProgram

OFF, READY, RUN = 0x0476, 0x0477, 0x047F
SPEED = 60.0


class WaitsForever(AxisProgram):
    def cycle(self, inputs, outputs, now):
        outputs.stw1, outputs.velocity = OFF, 0.0
        if self.name != "axis-1":
            return
        island = self.line.device("island")
        island.outputs.clamp = island.inputs.part_present
        if island.inputs.part_present:
            return
        if inputs.zsw1.operation_enabled:
            outputs.stw1, outputs.velocity = RUN, SPEED
        elif inputs.zsw1.ready_to_operate:
            outputs.stw1 = RUN
        elif inputs.zsw1.ready_to_switch_on:
            outputs.stw1 = READY
