"""Pick and place with SINA_POS on two axes: the program of `x` has the sequence, that of `z` does what it asks for."""

from sina_pos import ABSOLUTE, SET_REFERENCE, SinaPos

UNITS = 250.0  # LU per mm
PICK, PLACE, UP, DOWN = 0.0, 100.0, 0.0, 30.0
MILLISECONDS = 1_000_000
LONGEST = 1_000 * MILLISECONDS  # until the gripper's sensor answers


class Axis(SinaPos):
    """An axis that takes the place where it is for 0, and then goes where it is sent."""

    goal = None
    pulse = 0

    def __init__(self):
        self.ConfigEPos = 0x00000003
        self.Velocity = 30_000

    def go(self, place):
        """Have it move there; whether it is there."""
        if place != self.goal:
            self.goal, self.pulse = place, 3
        return self.pulse == 0 and self.AxisPosOk and abs(self.ActPosition - place * UNITS) < 0.5 * UNITS

    @property
    def ready(self):
        return self.AxisEnabled and self.AxisRef and not self.Error

    def drive(self, inputs, outputs, now):
        self.EnableAxis = not self.Error
        if not self.AxisRef:
            self.ModePos, self.ExecuteMode = SET_REFERENCE, self.AxisEnabled and not self.ExecuteMode
        else:
            self.ModePos, self.Position = ABSOLUTE, round((self.goal or 0.0) * UNITS)
            self.ExecuteMode = self.pulse == 2
            self.pulse = max(0, self.pulse - 1)
        super().cycle(inputs, outputs, now)


class PickAndPlace(Axis):
    """The right program."""

    step = "wait"
    count = 0
    alarm = False
    since = 0

    def cycle(self, inputs, outputs, now):
        if self.name == "x" and "z" in self.line:
            self.sequence(self.line.device("island"), self.line["z"], now)
        self.drive(inputs, outputs, now)

    def next(self, step, now):
        self.step, self.since = step, now

    def sequence(self, island, z, now):
        if not (island.connected and self.ready and z.ready):
            self.lost()
            return
        inputs, outputs = island.inputs, island.outputs
        outputs.alarm, outputs.counted = self.alarm, self.count % 256
        if self.step == "wait":
            if self.go(PICK) and z.go(UP) and self.may_pick(inputs):
                self.next("lower", now)
        elif self.step == "lower":
            if z.go(DOWN):
                outputs.close = True
                self.next("close", now)
        elif self.step == "close":
            if self.closed(inputs, now):
                self.next("lift", now)
        elif self.step == "lift":
            if z.go(UP):
                self.next("carry", now)
        elif self.step == "carry":
            # 0 = stop on the way
            self.IntermediateStop = self.held(inputs)
            if self.IntermediateStop and self.go(PLACE):
                self.next("put", now)
        elif self.step == "put":
            if z.go(DOWN):
                outputs.close = False
                self.next("open", now)
        elif self.step == "open":
            if self.opened(inputs, now):
                self.count += 1
                self.next("raise", now)
        elif self.step == "raise" and z.go(UP):
            self.next("wait", now)
        self.watch(inputs, now)

    # what programs get wrong

    def may_pick(self, inputs):
        return inputs.part_present and inputs.gripper_open

    def closed(self, inputs, now):
        return inputs.gripper_closed

    def held(self, inputs):
        return inputs.gripper_closed

    def opened(self, inputs, now):
        return inputs.gripper_open

    def watch(self, inputs, now):
        self.alarm = self.step in ("close", "open", "carry") and now - self.since > LONGEST

    def lost(self):
        pass
