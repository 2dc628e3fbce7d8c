"""Load of others: what all CPUs did, less what the benchmark's own processes used."""

import os

import pytest

from pnfarm.bench.load import LIMIT_CORES, Load, Mark, Process, cpu_times, load_between, process_of, used_by_tree
from pnfarm.errors import InternalError

STAT = """\
cpu  100 20 30 4000 50 6 7 80 9 0
cpu0 50 10 15 2000 25 3 3 40 4 0
cpu1 50 10 15 2000 25 3 4 40 5 0
intr 9771073 0 0
ctxt 1
"""


def mark(wall=0.0, idle=0.0, steal=0.0, own=0.0):
    return Mark(wall, 2, idle, steal, own)


def test_waiting_for_a_disk_is_idle_and_stolen_time_is_told_apart():
    assert cpu_times(STAT, 100) == (2, 40.5, 0.8)


def test_a_process_is_read_although_its_name_has_blanks_and_brackets():
    fields = ["S", "7", *["0"] * 9, "250", "50", "30", "20", "20", "0"]
    assert process_of(f"42 (a) b (c)) {' '.join(fields)}", 100) == Process(42, 7, 3.5)
    fields[1] = "2"
    assert process_of(f"60 (kworker/u8:1-ev) {' '.join(fields)}", 100).is_worker
    assert not process_of(f"61 (ksoftirqd/0) {' '.join(fields)}", 100).is_worker
    fields[1] = "7"
    assert not process_of(f"62 (kworker/0) {' '.join(fields)}", 100).is_worker


def test_this_process_is_read_as_the_kernel_shows_it():
    with open("/proc/self/stat", encoding="utf-8") as file:  # noqa: PTH123 - one read of a kernel file
        found = process_of(file.read(), os.sysconf("SC_CLK_TCK"))
    assert (found.pid, found.parent) == (os.getpid(), os.getppid())
    assert found.used > 0


def test_children_and_their_children_are_the_benchmarks_own_and_neighbours_are_not():
    processes = [
        Process(1, 0, 50.0),
        Process(10, 1, 1.0),
        Process(11, 10, 2.0),
        Process(12, 11, 4.0),
        Process(20, 1, 8.0),
    ]
    assert used_by_tree(processes, 10) == 7.0
    # what the kernel's workers do is done for those who ask
    assert used_by_tree([*processes, Process(60, 2, 0.5, is_worker=True)], 10) == 7.5
    assert used_by_tree(processes, 99) == 0.0


def test_load_is_what_was_neither_idle_nor_own():
    # 10 s of 2 CPUs: 12 s idle, 5 s own
    assert load_between(mark(), mark(wall=10.0, idle=12.0, own=5.0)) == pytest.approx(3.0)


def test_stolen_time_is_load_even_where_the_kernel_counts_it_as_the_benchmarks():
    assert load_between(mark(), mark(wall=10.0, idle=12.0, own=8.0, steal=2.0)) == pytest.approx(2.0)


def test_the_steps_of_the_kernels_counters_make_no_negative_load():
    assert load_between(mark(), mark(wall=1.0, idle=1.5, own=0.52)) == 0.0


def test_load_is_summed_over_all_windows_of_a_measurement():
    load = Load()
    load.add(4.0, 0.0)
    load.add(4.0, 2.0)
    assert load.cores == 0.25
    assert load.disturbing == 0.25


@pytest.mark.parametrize(("wall", "seconds", "disturbs"), [
    (10.0, LIMIT_CORES * 10.0, False), (10.0, 0.56, True), (0.1, 0.04, False), (0.1, 0.1, True),
])  # fmt: skip
def test_a_twentieth_of_a_core_disturbs_and_steps_of_the_counters_do_not(wall, seconds, disturbs):
    load = Load()
    load.add(wall, seconds)
    assert (load.disturbing is not None) is disturbs


def test_a_benchmark_that_watched_no_load_is_a_mistake_of_the_program():
    with pytest.raises(InternalError, match="did not watch"):
        _ = Load().disturbing


def test_time_that_this_process_spends_is_not_load_of_others():
    load = Load()
    with load:
        end = os.times().user + 0.2
        while os.times().user < end:
            pass
    assert load.wall >= 0.2
    # others may be busy on every other CPU, and on this one while it waits
    assert load.seconds <= load.wall * (os.cpu_count() or 1) - 0.1
