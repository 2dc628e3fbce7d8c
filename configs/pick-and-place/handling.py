"""The parts: they come to the place where they are picked, hang in the gripper, and end where it opens."""

PICK, PLACE, DOWN = 0.0, 100.0, 30.0  # mm
NEAR = 1.0


class Handling:
    inputs = {"x": "mm", "z": "mm", "closed": float, "starved": bool}
    outputs = {
        "part_present": bool,
        "held": bool,
        "placed": float,
        "dropped": float,
        "empty": float,
        "collisions": float,
    }

    def __init__(self):
        self.part_present = self.held = False
        self.placed = self.dropped = self.empty = self.collisions = 0.0
        self.until_next = 0.1
        self.was_closed = self.was_low = False
        self.last_x = 0.0

    def step(self, dt):
        low = self.z > DOWN - NEAR
        closed = self.closed > 0.9
        if not self.part_present and not self.starved:
            self.until_next -= dt
            self.part_present = self.until_next <= 0.0
        if closed and not self.was_closed:
            if low and abs(self.x - PICK) < NEAR and self.part_present:
                self.held, self.part_present, self.until_next = True, False, 0.1
            else:
                self.empty += 1
        if self.held and self.closed < 0.9:
            self.held = False
            if low and abs(self.x - PLACE) < NEAR:
                self.placed += 1
            else:
                self.dropped += 1
        # it moves sideways while the gripper is among the parts
        moving = abs(self.x - self.last_x) > 0.05
        if moving and self.z > DOWN / 2 and not self.was_low:
            self.collisions += 1
        self.was_low = moving and self.z > DOWN / 2
        self.last_x, self.was_closed = self.x, closed
