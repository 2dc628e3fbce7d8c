"""Wrong on purpose: does not look at ZSW1.3: keeps enable and set point through a fault, as if nothing had happened."""

from pnfarm import AxisProgram


class IgnoresFault(AxisProgram):
    def __init__(self):
        self.is_on = False

    def cycle(self, inputs, outputs, now):
        self.is_on = self.is_on or inputs.zsw1.operation_enabled
        outputs.velocity = 60.0
        if self.is_on or inputs.zsw1.ready_to_operate:
            outputs.stw1 = 0x047F
        else:
            outputs.stw1 = 0x0477 if inputs.zsw1.ready_to_switch_on else 0x0476
