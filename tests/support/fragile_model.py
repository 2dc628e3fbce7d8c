"""A model of a plant that a test breaks."""


class Fragile:
    inputs = {"break_now": bool, "gain": "mm"}  # noqa: RUF012
    outputs = {"twice": "mm"}  # noqa: RUF012

    def __init__(self):
        self.twice = 0.0

    def step(self, dt):
        if self.break_now:
            raise ValueError("the shaft broke")
        self.twice = 2 * self.gain
