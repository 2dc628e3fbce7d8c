"""Objects of a drive system without a motor of their own: an infeed, a control unit, an encoder."""

from __future__ import annotations

from bench_axis import BenchAxis
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pnfarm.table.axis_codes import OBJECT_CONTROL_UNIT, OBJECT_ENCODER, OBJECT_INFEED
from pnfarm.table.signals import A_DIGITAL_SET, STW2, ZSW1, ZSW2

CONTROL, ACKNOWLEDGE = 0x0400, 0x0080
OFF, ON, ENABLED = 0x0402, 0x0403, 0x040B
#: Bits of E_ZSW1: states, charged, contactor.
READY_TO_OPERATE, OPERATION, INHIBITED, CHARGED, CLOSED = 0x0002, 0x0004, 0x0040, 0x0800, 0x1000
EVERY = 0x02DF | CHARGED | CLOSED


class Object(BenchAxis):
    def __init__(self, kind: int) -> None:
        super().__init__()
        self.axis.profidrive.settings.object = kind
        self.axis.profidrive.settings.precharge = 0.008
        self.axis.life.settings.watched = 1

    def write_second(self, word: int, *, run: int = 1) -> int:
        """STW2_ENC or CU_STW1; ZSW2_ENC or CU_ZSW1."""
        self.image.received[STW2] = word
        self.write(0, run=run)
        return int(self.image.sent[ZSW2]) & 0x0FFF


def test_an_infeed_is_ready_for_operation_once_it_has_charged():
    infeed = Object(OBJECT_INFEED)
    assert infeed.write(OFF, run=2) & EVERY == 0x0211
    assert infeed.write(ON, run=2) & (READY_TO_OPERATE | CHARGED | CLOSED) == CLOSED
    assert infeed.write(ON, run=4) & READY_TO_OPERATE == 0
    assert infeed.write(ON, run=6) & (READY_TO_OPERATE | CHARGED | CLOSED) == READY_TO_OPERATE | CHARGED | CLOSED
    assert infeed.write(ENABLED, run=2) & OPERATION
    assert infeed.write(OFF, run=3) & (READY_TO_OPERATE | CHARGED | CLOSED) == 0
    assert infeed.write(ON, run=5) & (READY_TO_OPERATE | CHARGED | CLOSED) == CLOSED, "it charges again"


def test_an_infeed_that_is_switched_on_at_once_stays_inhibited():
    infeed = Object(OBJECT_INFEED)
    assert infeed.write(ON, run=12) & (INHIBITED | CLOSED) == INHIBITED
    assert infeed.write(OFF, run=2) & INHIBITED == 0


@settings(max_examples=12, deadline=None)
@given(
    st.lists(
        st.tuples(st.one_of(st.integers(0, 0xFFFF), st.sampled_from([OFF, ON, ENABLED])), st.integers(1, 8)),
        max_size=8,
    )
)
@example([(OFF, 1), (ON, 1), (0, 1), (0x07FF, 8), (OFF, 1)])
def test_whatever_an_infeed_is_told_it_is_ready_only_when_charged(words):
    infeed = Object(OBJECT_INFEED)
    for word, run in [*words, (OFF, 2), (ON, 10), (ENABLED, 2)]:
        infeed.write(word, run=run)
        shown = int(infeed.image.sent[ZSW1])
        assert shown & ~EVERY == 0, "only bits that E_ZSW1 has"
        assert not shown & READY_TO_OPERATE or shown & (CHARGED | CLOSED) == CHARGED | CLOSED
        assert not shown & CHARGED or shown & CLOSED
        assert abs(float(infeed.axis.motor.velocity)) < 1e-6, "no motor turns"


def test_a_control_unit_has_outputs_with_control_and_reports_its_fault():
    unit = Object(OBJECT_CONTROL_UNIT)
    unit.image.received[A_DIGITAL_SET] = 0xA5A5
    assert unit.write_second(0) == 0x0E00
    assert int(unit.axis.machine.outputs) == 0, "the controller has not taken control over"
    unit.write_second(CONTROL)
    assert int(unit.axis.machine.outputs) == 0xA5A5
    unit.axis.profidrive.settings.others_faulty = 1
    assert unit.write_second(CONTROL) == 0x0A00
    unit.axis.faults.code[0] = 12
    assert unit.write_second(CONTROL) == 0x0A08
    unit.axis.profidrive.settings.others_faulty = 0
    assert unit.write_second(CONTROL | ACKNOWLEDGE, run=2) == 0x0E00
    assert unit.axis.drive.state == 1


def test_an_encoder_shows_control_requested_and_no_group():
    assert Object(OBJECT_ENCODER).write_second(CONTROL) == 0x0200
