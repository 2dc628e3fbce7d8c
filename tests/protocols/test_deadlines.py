from hypothesis import given
from hypothesis import strategies as st

from pnfarm.protocols.deadlines import Deadlines, earliest


def test_the_earliest_is_taken_first_and_once():
    deadlines = Deadlines()
    for key, due in ((1, 30), (2, 10), (3, 20)):
        deadlines.set(key, due)
    assert deadlines.first() == 10
    assert deadlines.take(20) == [2, 3]
    assert deadlines.take(20) == []
    assert (deadlines.first(), len(deadlines)) == (30, 1)


def test_a_deadline_that_moved_counts_where_it_is_now():
    deadlines = Deadlines()
    deadlines.set(1, 10)
    deadlines.set(1, 50)
    assert (deadlines.first(), deadlines.take(10)) == (50, [])
    deadlines.set(1, 5)
    assert deadlines.take(10) == [1]
    deadlines.set(2, 7)
    deadlines.set(2, None)
    assert deadlines.first() is None


def test_memory_is_in_proportion_to_the_keys_however_often_they_are_set():
    deadlines = Deadlines()
    for turn in range(10_000):
        deadlines.set(turn % 10, turn)
    assert len(deadlines._heap) <= 2 * 10 + 64 + 1


@given(st.lists(st.tuples(st.integers(0, 5), st.none() | st.integers(0, 50)), max_size=200))
def test_any_settings_give_what_a_scan_gives(settings):
    deadlines, plain = Deadlines(), {}
    for key, due in settings:
        deadlines.set(key, due)
        plain.pop(key, None)
        if due is not None:
            plain[key] = due
        assert deadlines.first() == min(plain.values(), default=None)
    taken = deadlines.take(25)
    assert sorted(taken) == sorted(key for key, due in plain.items() if due <= 25)
    assert [plain[key] for key in taken] == sorted(plain[key] for key in taken)


class Machine:
    def __init__(self, due):
        self.due = due

    def next_deadline(self):
        return self.due


@given(st.lists(st.none() | st.integers(0, 50), max_size=8))
def test_the_earliest_of_some_machines_is_the_least_of_those_that_wait(dues):
    assert earliest(*map(Machine, dues)) == min((due for due in dues if due is not None), default=None)
