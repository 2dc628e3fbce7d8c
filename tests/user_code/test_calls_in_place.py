"""Calls of people's code in the main thread: what ends them, and what does not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress

import pytest

from pnfarm.user_code.caller import Caller
from pnfarm.user_code.calling_thread import Call
from pnfarm.user_code.in_place import SIGNAL

LIMIT_NS = 100_000_000


@pytest.fixture
def caller():
    caller = Caller()
    yield caller
    caller.close()


def run(caller: Caller, *actions):
    calls = [Call(action) for action in actions]
    for call in calls:
        caller.run(call, LIMIT_NS)
    return calls, [call for call in calls if call.duration_ns is None]


def test_calls_are_made_in_turn_in_the_thread_that_asks(caller):
    made = []
    calls, stuck = run(caller, *(lambda n=n: made.append((n, threading.get_ident())) for n in range(3)))
    assert made == [(n, threading.get_ident()) for n in range(3)]
    assert not stuck
    assert all(call.duration_ns > 0 and call.error is None for call in calls)


def test_what_a_call_raises_is_its_error_and_the_next_one_is_made(caller):
    (failed, left, right), stuck = run(caller, lambda: {}["gone"], sys.exit, lambda: None)
    assert isinstance(failed.error, KeyError)
    assert isinstance(left.error, SystemExit)
    assert right.error is None
    assert not stuck


def test_an_interrupt_at_the_terminal_is_no_error_of_the_call(caller):
    with pytest.raises(KeyboardInterrupt):
        run(caller, lambda: (_ for _ in ()).throw(KeyboardInterrupt()))


def test_a_call_that_ends_by_itself_behind_the_limit_has_exceeded_it(caller):
    def patient():
        end = time.monotonic() + 0.3
        while time.monotonic() < end:
            with suppress(BaseException):
                time.sleep(0.01)  # a wait in the kernel is what the signal breaks

    (late, right), stuck = run(caller, patient, lambda: None)
    assert stuck == [late]
    assert (late.error, late.duration_ns, right.error) == (None, None, None)
    assert right.duration_ns is not None


def test_the_signal_without_a_call_does_nothing(caller):
    run(caller, lambda: None)
    os.kill(os.getpid(), SIGNAL)
    # a wait in the kernel, which a signal that came late would break
    assert not run(caller, lambda: time.sleep(0.01))[1]


def test_a_machine_that_stands_for_longer_than_the_limit_is_not_the_calls_fault():
    # the call waits while its process is stopped
    code = (
        "import time\n"
        "from pnfarm.user_code.caller import Caller\n"
        "from pnfarm.user_code.calling_thread import Call\n"
        "def action():\n    print('begun', flush=True); time.sleep(0.1)\n"
        "caller = Caller()\n"
        "call = Call(action)\n"
        "caller.run(call, 2_000_000_000)\n"
        "print(call.duration_ns is None)\n"
        "caller.close()\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "begun\n"
        process.send_signal(signal.SIGSTOP)
        time.sleep(2.5)  # longer than the limit
        process.send_signal(signal.SIGCONT)
        assert process.stdout.readline() == "False\n"
