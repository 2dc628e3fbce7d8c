from pythonfmu3 import Boolean, Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability, Int32


class Tank(Fmi3Slave):
    """Its level rises by what flows in; at 7 it bursts."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = self.inflow = self.level = 0.0
        self.area = 1.0
        self.full = False
        self.litres = 0
        cause, vary = Fmi3Causality, Fmi3Variability
        self.register_variable(Float64("time", causality=cause.independent, variability=vary.continuous))
        self.register_variable(Float64("inflow", causality=cause.input, variability=vary.continuous, start=0.0))
        self.register_variable(Float64("level", causality=cause.output, variability=vary.continuous))
        self.register_variable(Boolean("full", causality=cause.output, variability=vary.discrete))
        self.register_variable(Int32("litres", causality=cause.output, variability=vary.discrete))
        self.register_variable(Float64("area", causality=cause.parameter, variability=vary.fixed, start=1.0))

    def do_step(self, current_time, step_size):
        self.level += self.inflow * step_size / self.area
        self.full = self.level >= 1.0
        self.litres = int(self.level * self.area * 1000)
        if self.level > 7.0:
            raise ValueError("the tank burst")
        return True
