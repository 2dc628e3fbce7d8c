"""The PLC program under test: acknowledges a fault by one edge, and brings its axis back to 60 rpm."""

from pnfarm import AxisProgram

OFF, READY, RUN = 0x0476, 0x0477, 0x047F


class MyPlc(AxisProgram):
    def __init__(self):
        self.fault_ns = None
        self.acknowledged = 0

    def cycle(self, inputs, outputs, now):
        outputs.stw1, outputs.velocity = OFF, 0.0
        if not inputs.valid:
            self.fault_ns = None
        elif inputs.zsw1.fault_present:
            self.fault_ns = self.fault_ns or now
            edge = (now - self.fault_ns) % 1_000_000_000 >= 200_000_000
            if edge and not self.acknowledging:
                self.acknowledged += 1
            self.acknowledging = outputs.stw1.fault_acknowledge = edge
        else:
            self.fault_ns, self.acknowledging = None, False
            if inputs.zsw1.operation_enabled:
                outputs.stw1, outputs.velocity = RUN, 60.0
            elif inputs.zsw1.ready_to_operate:
                outputs.stw1 = RUN
            elif inputs.zsw1.ready_to_switch_on:
                outputs.stw1 = READY

    acknowledging = False
