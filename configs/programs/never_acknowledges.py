"""Wrong on purpose: withdraws the enable at a fault, and never acknowledges it: the axis stays down."""

from pnfarm import AxisProgram


class NeverAcknowledges(AxisProgram):
    def cycle(self, inputs, outputs, now):
        outputs.stw1, outputs.velocity = 0x0476, 60.0
        if inputs.zsw1.ready_to_operate:
            outputs.stw1 = 0x047F
        elif inputs.zsw1.ready_to_switch_on:
            outputs.stw1 = 0x0477
