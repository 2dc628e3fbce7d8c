"""Wrong on purpose: acknowledges a fault, but holds STW1.0 to 3 meanwhile: the drive waits for the edge in S1."""

from pnfarm import AxisProgram


class NoEdge(AxisProgram):
    def __init__(self):
        self.is_on = False

    def cycle(self, inputs, outputs, now):
        self.is_on = self.is_on or inputs.zsw1.operation_enabled
        outputs.velocity = 60.0
        if self.is_on or inputs.zsw1.ready_to_operate:
            outputs.stw1 = 0x047F
        else:
            outputs.stw1 = 0x0477 if inputs.zsw1.ready_to_switch_on else 0x0476
        outputs.stw1.fault_acknowledge = inputs.zsw1.fault_present and now % 1_000_000_000 >= 500_000_000
