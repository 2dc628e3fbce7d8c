"""The pytest plugin: the fixture ``pnfarm_farm``.  Nothing else is imported before a test asks for it.

::

    def test_the_axis_runs(pnfarm_farm):
        line = pnfarm_farm("axis-01", model="hiwin-e1")
        line.wait_running()
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pnfarm.testing import Line

__all__ = ["Lines", "pnfarm_farm"]


class Lines:
    """Makes lines in memory (:class:`pnfarm.testing.Line`) and closes them at the end of the test."""

    def __init__(self) -> None:
        self._open: list[Line] = []

    def __call__(self, *names: str, **options: Any) -> Line:
        """Drives by name; arguments of :class:`pnfarm.testing.Line`."""
        from pnfarm.testing import Line  # noqa: PLC0415 - a session without a line does not pay for the engine

        return self._kept(Line(*names, **options))

    def from_file(self, path: str | Path) -> Line:
        """The drives and the controller of a farm file."""
        from pnfarm.testing import Line  # noqa: PLC0415 - as above

        return self._kept(Line.from_file(path))

    def from_text(self, text: str) -> Line:
        """As :meth:`from_file`, from the file's text."""
        from pnfarm.testing import Line  # noqa: PLC0415 - as above

        return self._kept(Line.from_text(text))

    def _kept(self, line: Line) -> Line:
        self._open.append(line)
        return line

    def close(self) -> None:
        """Close every line, also if one of them fails."""
        while self._open:
            self._open.pop().close()


@pytest.fixture
def pnfarm_farm() -> Iterator[Lines]:
    """Farms in memory, in virtual time: ``pnfarm_farm("axis-01", model="hiwin-e1")`` is a pnfarm.testing.Line."""
    lines = Lines()
    yield lines
    lines.close()
