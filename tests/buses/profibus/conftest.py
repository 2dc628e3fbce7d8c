"""Farms of drives on PROFIBUS in memory and virtual time."""

import pytest

from pnfarm.testing import Line

FARM = """
farm: dp
link: {{kind: memory{link}}}
drives:
  - {{name: 'msd-{{n:02}}', count: {count}, model: moog-msd-dp, {address}{more}}}
controller:
  name: plc
  cycle: {cycle}
  watchdog: {watchdog}
  {keys}
  program: {{kind: constant, speed_rpm: 300, acknowledge_after: 100ms}}
  reconnect: {{after: 200ms}}
"""


@pytest.fixture
def farm():
    """Makes a line; each is closed at the end."""
    made = []

    def make(count=1, *, address="address: 11", more="", keys="", cycle="5ms", link="", watchdog="100ms", running=True):
        text = FARM.format(
            count=count, address=address, more=more, keys=keys, cycle=cycle, link=link, watchdog=watchdog
        )
        line = Line.from_text(text)
        made.append(line)
        if running:
            line.wait_running(5)
        return line

    yield make
    for line in made:
        line.close()
