"""Calls of people's code in real time: by one thread, and by another one where a call does not return."""

from __future__ import annotations

import threading
import time

import pytest

from pnfarm.user_code.calling_thread import Call
from pnfarm.user_code.thread import CodeThread

LIMIT_NS = 50_000_000
PATIENCE = 20.0


class Rounds:
    """A runner whose work is one list of actions, each time; it ends the thread's waiting when they were made."""

    limit_ns = LIMIT_NS

    def __init__(self, *actions, rounds: int = 1, fails: Exception | None = None) -> None:
        self.actions = actions
        self.left = rounds
        self.fails = fails
        self.made: list[list[Call]] = []
        self.threads: list[threading.Thread] = []
        self.done = threading.Event()
        self.is_closed = False

    def next_deadline(self) -> int | None:
        if not self.left:
            self.done.set()
            return None
        return 0

    def work(self, now: int):
        self.left -= 1
        calls = [Call(action) for action in self.actions]
        yield from calls
        self.threads.append(threading.current_thread())
        self.made.append(calls)
        if self.fails is not None:
            raise self.fails

    def close(self) -> None:
        self.is_closed = True


@pytest.fixture
def run():
    threads: list[CodeThread] = []
    failures: list[Exception] = []

    def run(runner: Rounds) -> list[Exception]:
        threads.append(CodeThread(runner, lambda exc: (failures.append(exc), runner.done.set()), "code"))
        threads[-1].start()
        assert runner.done.wait(PATIENCE)
        return failures

    yield run
    for thread in threads:
        thread.close()


def test_calls_are_made_in_turn_by_one_thread(run):
    made = []
    runner = Rounds(*(lambda n=n: made.append((n, threading.current_thread())) for n in range(3)), rounds=2)
    assert run(runner) == []
    assert [n for n, _ in made] == [0, 1, 2, 0, 1, 2]
    assert {thread for _, thread in made} == set(runner.threads)
    assert len(set(runner.threads)) == 1
    assert all(call.duration_ns is not None for calls in runner.made for call in calls)


def test_behind_a_call_that_waits_for_good_the_next_ones_are_made_in_another_thread(run):
    release, made = threading.Event(), []

    def wait():
        # what returns behind the limit has no effect
        release.wait()

    runner = Rounds(wait, lambda: made.append(threading.current_thread()))
    run(runner)
    waiting, right = runner.made[0]
    assert waiting.duration_ns is None
    assert right.duration_ns is not None
    assert made == runner.threads
    release.set()


def test_a_call_that_loops_for_good_is_ended(run):
    ended = threading.Event()

    def loop():
        try:
            while True:
                pass
        finally:
            ended.set()

    runner = Rounds(loop, loop, rounds=2)
    run(runner)
    assert [call.duration_ns for calls in runner.made for call in calls] == [None] * 4
    assert len(set(runner.threads)) == 2
    assert ended.wait(PATIENCE)


def test_what_a_call_raises_is_its_error(run):
    runner = Rounds(lambda: {}["gone"], lambda: None)
    run(runner)
    failed, right = runner.made[0]
    assert isinstance(failed.error, KeyError)
    assert right.error is None


def test_an_exception_of_the_runner_itself_is_reported_and_ends_the_work(run):
    error = ValueError("no such row")
    runner = Rounds(lambda: None, rounds=5, fails=error)
    assert run(runner) == [error]
    assert runner.left == 4


def test_closing_waits_for_the_calls_under_way_and_not_for_one_that_does_not_return():
    begun, release, made = threading.Event(), threading.Event(), []

    def wait():
        begun.set()
        release.wait()

    runner = Rounds(wait, lambda: made.append(1), rounds=1000)
    thread = CodeThread(runner, pytest.fail, "code")
    thread.start()
    assert begun.wait(PATIENCE)
    thread.close()
    assert made == [1]
    assert runner.is_closed
    release.set()


def test_the_threads_of_closed_work_are_gone():
    before = threading.active_count()
    runner = Rounds(lambda: None)
    thread = CodeThread(runner, pytest.fail, "code")
    thread.start()
    assert runner.done.wait(PATIENCE)
    thread.close()
    assert threading.active_count() == before


def test_a_call_just_within_the_limit_has_not_exceeded_it(run):
    runner = Rounds(lambda: time.sleep(LIMIT_NS / 2e9))  # what is measured is the wait itself
    run(runner)
    assert runner.made[0][0].duration_ns is not None
