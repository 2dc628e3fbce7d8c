"""Noise of measured values as a PLC sees it, on every model."""

from __future__ import annotations

import statistics

import pytest
from hand_plc import HandPlc
from virtual_line import VirtualLine

from pnfarm.drives.parameters.factor_group import float_of
from pnfarm.farm.views.snapshot import drive_snapshot
from pnfarm.table.signals import ACTUAL_SLOTS

#: Model, telegram, cycle, control words to S4, the signal of the speed.
MODELS = [
    ("akd-profinet", 1, "16ms", "NIST_A"),
    ("akd-profinet-2012", 1, "8ms", "NIST_A"),
    ("hiwin-e1", 3, "1ms", "NIST_B"),
    ("moog-msd", 3, "1ms", "NIST_B"),
]
#: The AKD's own walk through its states (7.1.4).
OPERATION = 0x047F
RPM_STEP = 1638 * 60 * 16000 / 2**32


class Plc(HandPlc):
    """With the cycle of the model, in seconds."""

    def __init__(self, model: str, telegram: int, cycle: str, **options) -> None:
        self.FRAME = int(cycle.removesuffix("ms")) / 1000.0
        super().__init__(model, telegram, cycle=cycle, **options)


def test_akd_7_1_4_the_sample_of_the_manual_appears():
    """ZSW1 0x0237 with STW1 0x047F, set point 0x00A3 and actual value 0x009E: neither bit 8 nor bit 10."""
    plc = Plc("akd-profinet", 1, "16ms", realism="{noise: on}")
    plc.switch_on(operation=0x040F)
    plc.put(STW1=OPERATION, NSOLL_A=0x00A3, wait=100)

    def sample() -> tuple[int, int]:
        return plc["ZSW1"], plc["NIST_A"]

    plc.wait_for(lambda: sample() == (0x0237, 0x009E))
    plc.wait_for(lambda: sample()[0] == 0x0737)


def test_without_noise_the_same_drive_comes_to_rest_on_its_set_point():
    plc = Plc("akd-profinet", 1, "16ms")
    plc.switch_on(operation=0x040F)
    plc.put(STW1=OPERATION, NSOLL_A=0x00A3, wait=100)
    seen = set()
    for _ in range(200):
        plc.wait()
        seen.add((plc["ZSW1"], plc["NIST_A"]))
    assert seen == {(0x0737, 0x00A3)}


@pytest.mark.parametrize(("model", "telegram", "cycle", "signal"), MODELS)
def test_the_actual_speed_hunts_and_the_shaft_does_not(model, telegram, cycle, signal):
    line = VirtualLine(model=model, telegram=telegram, cycle=cycle, realism="{noise: {velocity: 2.0}}",
                       program="{kind: constant, speed_rpm: 300}")  # fmt: skip
    line.enable()
    line.run(2.0)
    image = line.plc.columns.image[0]
    shown, true = [], []
    for _ in range(150):
        line.run(int(cycle.removesuffix("ms")) / 1000.0)
        shown.append(int(image.received[ACTUAL_SLOTS[signal]]))
        snapshot = drive_snapshot(line.farm, line.farm.axes[0], line.world.now)
        true.append(snapshot["velocity_rpm"])
    assert max(true) - min(true) < 0.5, "what metrics and API tell of is the motor itself"
    assert len(set(shown)) > 5
    full = statistics.fmean(shown)
    assert statistics.pstdev(shown) / full * 300.0 == pytest.approx(2.0, rel=0.3)


@pytest.mark.parametrize(("model", "telegram", "cycle", "signal"), MODELS)
def test_the_bits_that_compare_the_speed_hunt(model, telegram, cycle, signal):
    del signal
    # as much noise as the window of the model is wide
    line = VirtualLine(model=model, telegram=telegram, cycle=cycle, program="{kind: constant, speed_rpm: 300}")
    window = float(line.farm.columns.axis[0].ramp.settings.velocity_window)
    line = VirtualLine(model=model, telegram=telegram, cycle=cycle, program="{kind: constant, speed_rpm: 300}",
                       realism=f"{{noise: {{velocity: {window}}}}}")  # fmt: skip
    line.enable()
    line.run(2.0)
    image = line.plc.columns.image[0]
    seen = set()
    for _ in range(200):
        line.run(int(cycle.removesuffix("ms")) / 1000.0)
        seen.add(int(image.received[0]) & 0x0500)
    wanted = {0x0100, 0x0400} if model != "moog-msd" else {0x0100}
    for bit in wanted:
        assert {word & bit for word in seen} == {0, bit}, hex(bit)


def test_parameters_show_the_measured_values_too():
    line = VirtualLine(realism="{noise: {velocity: 2.0, current: 0.5, position: 0.01}}")
    line.enable()
    line.run(1.0)
    store = line.farm.axes[0].store
    seen: dict[str, list[int]] = {name: [] for name in ("VL.FB", "IL.FB", "FB1.P", "VL.ERR", "FB1.MECHPOS")}
    for _ in range(300):
        line.run(0.016)
        for name, values in seen.items():
            values.append(store.get(name))
    assert statistics.pstdev(seen["VL.FB"]) == pytest.approx(2000.0, rel=0.2)
    assert statistics.pstdev(seen["VL.ERR"]) == pytest.approx(2000.0, rel=0.2)
    assert statistics.pstdev(seen["IL.FB"]) == pytest.approx(500.0, rel=0.2)
    assert len(set(seen["FB1.P"])) == 300


def test_an_msd_shows_noise_in_its_current_and_its_speed_difference():
    line = VirtualLine(model="moog-msd", cycle="1ms", realism="{noise: {velocity: 2.0, current: 0.5}}")
    line.enable()
    line.run(1.0)
    store = line.farm.axes[0].store
    currents, differences = [], []
    for _ in range(300):
        line.run(0.004)
        currents.append(float_of(store.get("P-0700")))
        differences.append(float_of(store.get("P-0417")))
    assert statistics.pstdev(currents) == pytest.approx(0.5, rel=0.2)
    assert statistics.pstdev(differences) > 0.0


@pytest.mark.parametrize(("model", "telegram"), [("hiwin-e1", 3), ("moog-msd", 3)])
def test_the_position_of_the_sensor_interface_hunts(model, telegram):
    plc = Plc(model, telegram, "1ms", realism="{noise: {position: 1.0e-4}}")
    seen = set()
    for _ in range(100):
        plc.wait()
        seen.add(plc["G1_XIST1"])
    assert len(seen) > 50


def test_drives_of_a_group_differ_and_a_seed_makes_the_same_farm_again():
    def run(seed: int) -> list[list[int]]:
        line = VirtualLine(2, realism=f"{{noise: {{velocity: 2.0}}, seed: {seed}}}")
        line.enable()
        found: list[list[int]] = [[], []]
        for _ in range(50):
            line.run(0.016)
            for drive in range(2):
                found[drive].append(int(line.plc.columns.image[drive].received[1]))
        return found

    first, again, other = run(1), run(1), run(2)
    assert first == again
    assert first != other
    assert first[0] != first[1]


def test_a_parameter_shows_the_same_noise_as_the_frame():
    """Noise is constant for a whole firmware step: two ways to read a value agree."""
    line = VirtualLine(realism="{noise: {velocity: 5.0}}")
    line.enable()
    line.run(1.0)
    axis, store = line.farm.columns.axis[0], line.farm.axes[0].store
    sent = int(line.farm.columns.image[0].sent[ACTUAL_SLOTS["NIST_A"]])
    assert store.get("VL.FB") == pytest.approx(sent * RPM_STEP * 1000.0, abs=RPM_STEP * 500.0)
    assert abs(store.get("VL.FB") - float(axis.motor.velocity) * 1000.0) > 0.0
