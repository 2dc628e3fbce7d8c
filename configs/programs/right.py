"""A PLC program as it should be: watches the sign of life, acknowledges once, and enables by an edge."""

from pnfarm import AxisProgram

OFF, READY, RUN = 0x0476, 0x0477, 0x047F
SPEED = 60.0
ACKNOWLEDGE_AFTER = 500_000_000
LIFE_LOST_AFTER = 10  # cycles


class Right(AxisProgram):
    def __init__(self):
        self.fault_ns = None
        self.life = -1
        self.silent = 0

    def cycle(self, inputs, outputs, now):
        outputs.stw1, outputs.velocity = OFF, 0.0
        if not inputs.valid or not self.alive(inputs):
            self.fault_ns = None
            return
        if inputs.zsw1.fault_present:
            self.fault_ns = self.fault_ns or now
            # one rising edge of STW1.7, half a second after the fault, and another one each second
            outputs.stw1.fault_acknowledge = (now - self.fault_ns) % 1_000_000_000 >= ACKNOWLEDGE_AFTER
            return
        self.fault_ns = None
        if inputs.zsw1.operation_enabled:
            outputs.stw1, outputs.velocity = RUN, SPEED
        elif inputs.zsw1.ready_to_operate:
            outputs.stw1 = RUN
        elif inputs.zsw1.ready_to_switch_on:
            outputs.stw1 = READY

    def alive(self, inputs):
        """Whether the drive's sign of life (ZSW2, bits 12 to 15) goes on, where the drive counts one."""
        if "zsw2" not in inputs or not inputs.zsw2.sign_of_life:
            return True
        self.silent = self.silent + 1 if inputs.zsw2.sign_of_life == self.life else 0
        self.life = inputs.zsw2.sign_of_life
        return self.silent < LIFE_LOST_AFTER
