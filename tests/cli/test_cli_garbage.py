"""What a start leaves behind is out of the searches for unreachable objects; what comes later is found."""

import gc

import pytest

from pnfarm.cli.main import main
from pnfarm.farm.process.garbage import NEW_OBJECTS, keep_what_is_loaded


class Circle:
    alive = 0

    def __init__(self):
        self.own = self
        Circle.alive += 1

    def __del__(self):
        Circle.alive -= 1


@pytest.mark.asyncio
async def test_a_start_is_out_of_the_searches_for_garbage_and_what_comes_later_is_found():
    Circle()
    try:
        keep_what_is_loaded()
        # garbage of the start itself is gone
        assert (Circle.alive, gc.get_freeze_count() > 10_000) == (0, True)
        Circle()
        assert Circle.alive == 1
        gc.collect()
        assert Circle.alive == 0
    finally:
        gc.unfreeze()


def test_a_command_searches_less_often_than_python_does_by_itself_and_goes_on_searching(capsys):
    before = gc.get_threshold()
    try:
        gc.set_threshold(700, 10, 10)
        assert main(["--version"]) == 0
        assert gc.get_threshold() == (NEW_OBJECTS, 10, 10)
        Circle()
        kept = [[] for _ in range(2 * NEW_OBJECTS)]
        assert (len(kept), Circle.alive) == (2 * NEW_OBJECTS, 0)
    finally:
        gc.set_threshold(*before)
