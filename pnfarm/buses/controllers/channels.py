"""The cyclic channels of a controller's sessions as rows of the channel tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.engine.channels.schedule import ChannelTable

if TYPE_CHECKING:
    from pnfarm.buses.controllers.session import Session
    from pnfarm.engine.columns import Columns
    from pnfarm.links.base import Port

__all__ = ["ChannelRows"]


class ChannelRows:
    """``port`` is where the controller's frames go out and come in."""

    def __init__(self, columns: Columns, port: Port) -> None:
        self._columns = columns
        self._table = ChannelTable(columns)
        self._port = port

    def close_rows(self, session: Session) -> None:
        """A row starts at zero for its next connection; the station's totals do not."""
        for row in session.providers:
            self._table.close_provider(row)
            session.measures.frames_sent += int(self._columns.ppm[row].sent)
        for row in session.consumers:
            self._table.close_consumer(row)
            session.measures.frames_received += int(self._columns.cpm[row].received)
        session.providers.clear()
        session.consumers.clear()
