"""Wrong on purpose: one drive's fault, or its lost connection, switches the whole line off and on again."""

from pnfarm import AxisProgram


class RestartsLine(AxisProgram):
    def cycle(self, inputs, outputs, now):
        outputs.stw1, outputs.velocity = 0x0476, 60.0
        if any(not axis.connected or axis.inputs.zsw1.fault_present for axis in self.line):
            outputs.stw1.fault_acknowledge = inputs.zsw1.fault_present and now % 1_000_000_000 >= 500_000_000
        elif inputs.zsw1.ready_to_operate:
            outputs.stw1 = 0x047F
        elif inputs.zsw1.ready_to_switch_on:
            outputs.stw1 = 0x0477
