"""A sign of life that stands or skips: what the controller sees of the drive's, and the drive of the controller's."""

import itertools

import pytest
from fault_line import FaultLine

from pnfarm.errors import ConfigError
from pnfarm.table.signals import ZSW2

CYCLE = 0.004
LINES = {
    "hiwin-e1": {"cycle": "4ms", "telegram": 3},
    "moog-msd": {"cycle": "4ms", "telegram": 3},
    "akd-profinet": {"telegram": 9, "behaviour": "{sign-of-life: sent}", "cycle": "16ms"},
}
FOLLOWS = {count: count % 15 + 1 for count in range(1, 16)}


def line_of(model: str) -> FaultLine:
    line = FaultLine(model=model, watchdog=10, **LINES[model])
    line.connect(20.0)
    line.run(1.0)
    return line


def counts(line: FaultLine, cycles: int) -> list[int]:
    """The sign of life in each of the drive's next frames, as the controller takes them."""
    seen = []
    cycle = int(line.input_row().cycle_ns) / 1e9
    for _ in range(cycles):
        line.run(cycle)
        seen.append(int(line.plc.columns.image[0].received[ZSW2]) >> 12 & 0xF)
    return seen


def failed(seen: list[int]) -> int:
    """How many of them do not follow the one before."""
    return sum(after != FOLLOWS[before] for before, after in itertools.pairwise(seen))


def life(line: FaultLine):
    return line.farm.columns.axis[0].life


@pytest.mark.parametrize("model", ["hiwin-e1", "moog-msd"])
@pytest.mark.parametrize("kind", ["sign-of-life-freeze", "sign-of-life-loss"])
def test_a_frozen_sign_of_life_stands_for_as_many_frames_as_asked_and_goes_on_as_the_drives_own(model, kind):
    line = line_of(model)
    assert failed(counts(line, 20)) == 0
    fault = line.add(kind, count=6)
    seen = counts(line, 12)
    held = max(seen.count(count) for count in set(seen))
    assert held == 6
    assert failed(seen) == 6  # five that stand, and the one that follows
    assert fault.state == "ended"
    assert fault.evidence().activations == 6
    assert fault.evidence().confirmed
    line.run(0.1)
    assert failed(counts(line, 20)) == 0
    assert line.losses() == 0
    assert line.rows_free()


def test_a_sign_of_life_that_skips_fails_once_for_each_skip_and_once_at_its_end():
    line = line_of("hiwin-e1")
    seen = counts(line, 2)
    fault = line.add("sign-of-life-skip", count=3, probability=0.2, seed=4, params={"by": 2})
    seen += counts(line, 60)
    assert fault.state == "ended"
    assert fault.evidence().activations == 3
    assert failed(seen) == 4
    assert failed(counts(line, 20)) == 0


def test_a_drive_whose_controller_stands_raises_its_own_fault():
    line = line_of("hiwin-e1")
    line.enable(10.0)
    before = int(life(line).errors)
    fault = line.add("sign-of-life-freeze", direction="in", for_="500ms")
    assert line.until(lambda: int(life(line).errors) > before, 1.0)
    assert line.until(lambda: bool(line.farm.columns.axis[0].faults.code[0]), 1.0)
    assert line.until(lambda: fault.state == "ended", 1.0)
    line.run(0.2)
    assert line.losses() == 0
    before = int(life(line).errors)
    line.run(1.0)
    assert int(life(line).errors) == before


@pytest.mark.parametrize("kind", ["sign-of-life-freeze", "sign-of-life-loss", "sign-of-life-skip"])
def test_a_drive_or_a_telegram_without_a_sign_of_life_refuses_it_with_the_reason(kind):
    line = FaultLine()
    line.connect()
    with pytest.raises(ConfigError, match=r"axis-01 \(akd-profinet\) has no sign of life: as it is set up"):
        line.add(kind)
    assert not line.faults.list()
    assert line.rows_free()
    msd = FaultLine(model="moog-msd", cycle="4ms", telegram=1)
    msd.connect(20.0)
    with pytest.raises(ConfigError, match="axis-01 has no sign of life at present: its telegram lacks ZSW2"):
        msd.add(kind)
    with pytest.raises(ConfigError, match="its telegram lacks STW2"):
        msd.add(kind, direction="in")


def test_two_drives_with_one_without_a_sign_of_life_take_nothing():
    line = FaultLine(2, model="moog-msd", cycle="4ms", telegram=1)
    line.connect(20.0)
    with pytest.raises(ConfigError, match="axis-01 has no sign of life"):
        line.add("sign-of-life-loss", for_="1s")
    assert line.rows_free()


def test_a_frozen_sign_of_life_outlives_a_connection_that_breaks_and_ends_with_a_reset():
    line = line_of("hiwin-e1")
    fault = line.add("sign-of-life-freeze")
    line.run(0.1)
    line.add("ar-abort")
    line.run(0.05)
    line.connect(10.0)
    line.run(0.2)
    before = fault.evidence().activations
    seen = counts(line, 5)
    assert len(set(seen)) == 1
    assert fault.evidence().activations > before
    line.clear()
    line.run(0.1)
    assert failed(counts(line, 20)) == 0
    assert line.rows_free()
