"""The parameter channel's way through the drive: one task at a time, and no answer twice."""

from __future__ import annotations

import pytest
from from_python import called

from pnfarm.firmware.profidrive.parameter_words import REPEAT_NS, exchange
from pnfarm.table.image import IMAGE
from pnfarm.table.signals import PKW_HEAD, PKW_VALUE

TASK = 0x1396_0000_0000_0007
NEXT = -0x6C6A_0000_0000_0000  # 0x9396...: the identifier's highest bit is the number's sign
START = 1_000_000_000_000


class Image:
    def __init__(self):
        self.row = IMAGE.allocate(1)[0]
        self.row.valid = 1
        self.now = START
        self.row.parameter_told_ns = START

    def put(self, octets: int) -> None:
        self.row.received[PKW_HEAD] = octets >> 32
        low = octets & 0xFFFFFFFF
        self.row.received[PKW_VALUE] = low - (1 << 32) if low >> 31 else low

    def told(self, later: int = 1_000_000) -> bool:
        self.now += later
        return bool(called(exchange)(self.row, self.now))

    def answer(self, octets: int) -> None:
        self.row.parameter_answer = octets
        self.row.parameter_answered = self.row.parameter_task

    @property
    def sent(self) -> int:
        return int(self.row.sent[PKW_HEAD]) << 32 | int(self.row.sent[PKW_VALUE]) & 0xFFFFFFFF


@pytest.fixture
def image():
    return Image()


@pytest.mark.parametrize("octets", [TASK, NEXT, -1, 1, 1 << 31, -(1 << 31), (1 << 63) - 1, -(1 << 63)])
def test_a_task_is_reported_once_and_its_answer_sent(image, octets):
    image.put(octets)
    assert image.told()
    assert int(image.row.parameter_task) == octets
    assert not image.told()
    image.answer(octets)
    assert not image.told()
    assert image.sent == octets


def test_the_next_task_waits_for_the_answer_to_this_one(image):
    image.put(TASK)
    assert image.told()
    image.put(NEXT)
    assert not image.told()
    image.answer(5)
    assert image.told()
    assert int(image.row.parameter_task) == NEXT
    # until that one is answered, the last answer stays
    assert image.sent == 5


def test_no_task_is_nothing_to_report(image):
    assert not image.told(10 * REPEAT_NS)


def test_an_answer_that_does_not_come_is_asked_for_again(image):
    image.put(TASK)
    assert image.told()
    assert not image.told(REPEAT_NS - 1)
    assert image.told(1)
    assert not image.told()


def test_a_value_that_shall_stay_up_to_date_is_asked_for_again_and_others_are_not(image):
    image.put(TASK)
    image.told()
    image.answer(5)
    assert not image.told(10 * REPEAT_NS)
    image.row.parameter_repeats = 1
    assert image.told(10 * REPEAT_NS)
    assert not image.told(REPEAT_NS - 1)
    assert image.told(1)


def test_without_valid_set_points_there_is_no_task_and_no_answer(image):
    image.put(TASK)
    image.told()
    image.answer(5)
    image.told()
    image.row.valid = 0
    assert image.told()
    assert (int(image.row.parameter_task), image.sent) == (0, 0)
    image.answer(0)
    image.row.valid = 1
    assert image.told()
    assert int(image.row.parameter_task) == TASK
