"""The image of a slave between two threads: the engine steps the drive, the event loop has the line."""

from types import SimpleNamespace

import pytest

from pnfarm.buses.profibus.device.image import CyclicImage
from pnfarm.drives.profiles.profidrive.pkw import NO_TASK, Pkw, emit_pkw
from pnfarm.engine.columns import allocate
from pnfarm.firmware.profidrive.parameter_words import exchange
from pnfarm.table.image import LOST_CLOSED, LOST_EXPIRED, LOST_STOP
from pnfarm.table.signals import PART_HIGH, PART_LOW, PKW_HEAD, PKW_VALUE, STW1, word_code

CODES = (
    *(word_code(slot, part) for slot in (PKW_HEAD, PKW_VALUE) for part in (PART_HIGH, PART_LOW)),
    word_code(STW1),
)  # fmt: skip


class Watched(dict):
    """Words of an image; ``seen`` has what the other thread may read behind each write: identifier and value."""

    def __init__(self):
        super().__init__({PKW_HEAD: 0, PKW_VALUE: 0})
        self.seen = []

    def __setitem__(self, slot, value):
        super().__setitem__(slot, value)
        octets = b"".join(int(self[one]).to_bytes(4, "big", signed=True) for one in (PKW_HEAD, PKW_VALUE))
        self.seen.append(octets)

    def tasks(self):
        """Those that were seen, whole or not."""
        return {octets for octets in self.seen if octets[0] >> 4}


@pytest.mark.parametrize("why", [LOST_STOP, LOST_EXPIRED, LOST_CLOSED])
def test_no_step_takes_the_zeros_of_an_end_for_a_control_word_or_misses_why_it_ended(why):
    image = CyclicImage(allocate(images=1, channels=1).image[0])
    image.layout(CODES, ())
    image.take(bytes(8) + b"\x04\x7f", 1)
    seen = []

    class Field:
        """One of the image's, whose every writing is a moment at which the engine may step."""

        def __init__(self, values):
            self.values = values

        def __len__(self):
            return len(self.values)

        def __getitem__(self, place):
            return self.values[place]

        def __setitem__(self, place, value):
            self.values[place] = value
            seen.append((int(image._valid[0]), int(image._lost[0]), int(image._received[STW1])))

    image._received, image._valid, image._lost = Field(image._received), Field(image._valid), Field(image._lost)
    if why == LOST_STOP:
        image.clear(2)
    else:
        image.stop(why)
    assert {stw1 for valid, _, stw1 in seen if valid} <= {0x047F}
    assert {lost for valid, lost, _ in seen if not valid} == {why}
    assert seen[-1] == (0, why, 0)


def test_no_value_of_a_task_meets_the_identifier_of_another_one():
    image = CyclicImage(allocate(images=1, channels=1).image[0])
    image.layout(CODES, ())
    image._received = watched = Watched()
    first, second, third = Pkw(3, 1256, value=7), Pkw(3, 1257, value=0x80000009), Pkw(3, 1257, value=8)
    for task in (first, NO_TASK, second, third, third, first):
        image.take(emit_pkw(task) + b"\x04\x7f", 1)
    assert watched.tasks() <= {emit_pkw(one) for one in (first, second, third)}
    assert watched[STW1] == 0x047F


def test_a_task_that_stands_is_not_taken_back():
    image = CyclicImage(allocate(images=1, channels=1).image[0])
    image.layout(CODES, ())
    image._received = watched = Watched()
    task = emit_pkw(Pkw(3, 1256, value=7)) + b"\x04\x7f"
    image.take(task, 1)
    watched.seen.clear()
    image.take(task, 2)
    assert set(watched.seen) == {task[:8]}, "the engine would carry it out again"


def test_no_identifier_of_an_answer_is_sent_before_its_value():
    one, other = Pkw(2, 1256, value=7), Pkw(2, 1257, value=0x80000009)
    sent = Watched()
    image = SimpleNamespace(
        valid=1, received={PKW_HEAD: 0, PKW_VALUE: 0}, sent=sent, parameter_answer=0, parameter_told_ns=0,
        parameter_answered=0, parameter_task=0, parameter_repeats=0,
    )  # fmt: skip
    for answer in (one, other):
        image.parameter_answer = int.from_bytes(emit_pkw(answer), "big", signed=True)
        sent.seen.clear()
        getattr(exchange, "py_func", exchange)(image, 1)
        assert emit_pkw(answer)[:4] + bytes(4) not in sent.seen
        assert [octets for octets in sent.seen if octets[:4] == emit_pkw(answer)[:4]] == [emit_pkw(answer)]
