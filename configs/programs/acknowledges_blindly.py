"""Wrong on purpose: pulses STW1.7 in a loop, fault or not: nobody ever sees why the axis stopped."""

from pnfarm import AxisProgram


class AcknowledgesBlindly(AxisProgram):
    def __init__(self):
        self.count = 0

    def cycle(self, inputs, outputs, now):
        self.count += 1
        outputs.stw1, outputs.velocity = 0x0476, 60.0
        if inputs.zsw1.ready_to_operate:
            outputs.stw1 = 0x047F
        elif inputs.zsw1.ready_to_switch_on:
            outputs.stw1 = 0x0477
        outputs.stw1.fault_acknowledge = self.count // 4 % 2
