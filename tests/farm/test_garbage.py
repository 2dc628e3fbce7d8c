"""What is dead does not stay in memory, and what a start loaded is not searched."""

import asyncio
import gc

import pytest

from pnfarm.farm.process import garbage


class Life:
    """Refers to itself, as the state machines of a drive do."""

    def __init__(self):
        self.own = self


def lives():
    return sum(type(one) is Life for one in gc.get_objects())


async def looked():
    """A look is due at once: the loop finds that in one turn, and carries it out in the next."""
    for _ in range(2):
        await asyncio.sleep(0)  # one turn of the loop


@pytest.fixture
def searched(monkeypatch):
    """As in a program that has started, with a look at each turn of the loop."""
    before = gc.get_threshold()
    monkeypatch.setattr(garbage, "LOOK_SECONDS", 0.0)
    garbage.search_seldom()
    yield
    gc.unfreeze()
    gc.set_threshold(*before)


@pytest.mark.asyncio
async def test_what_died_when_it_was_old_is_forgotten_once_it_is_much(searched):
    garbage.keep_what_is_loaded()
    old = [Life() for _ in range(garbage.ENOUGH_OBJECTS)]
    gc.collect(1)
    old.clear()
    more = [Life() for _ in range(garbage.ENOUGH_OBJECTS)]
    await looked()
    assert lives() == len(more)


@pytest.mark.asyncio
async def test_little_that_is_new_is_not_worth_a_search(searched, monkeypatch):
    garbage.keep_what_is_loaded()
    monkeypatch.setattr(gc, "collect", lambda *_: pytest.fail("a search"))
    few = [Life() for _ in range(100)]
    await looked()
    assert len(few) == 100


@pytest.mark.asyncio
async def test_what_was_loaded_is_left_out_of_the_searches(searched):
    loaded = [Life() for _ in range(100)]
    garbage.keep_what_is_loaded()
    assert (lives(), len(loaded)) == (0, 100)
