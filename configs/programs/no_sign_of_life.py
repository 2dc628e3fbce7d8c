"""Wrong on purpose: does not watch the drive's sign of life (ZSW2, bits 12 to 15): a drive that froze stays enabled."""

from pnfarm import AxisProgram


class NoSignOfLife(AxisProgram):
    def __init__(self):
        self.fault_ns = None

    def cycle(self, inputs, outputs, now):
        outputs.stw1, outputs.velocity = 0x0476, 0.0
        if inputs.zsw1.fault_present:
            self.fault_ns = self.fault_ns or now
            outputs.stw1.fault_acknowledge = (now - self.fault_ns) % 1_000_000_000 >= 500_000_000
            return
        self.fault_ns = None
        if inputs.zsw1.ready_to_operate:
            outputs.stw1, outputs.velocity = 0x047F, 60.0
        elif inputs.zsw1.ready_to_switch_on:
            outputs.stw1 = 0x0477
