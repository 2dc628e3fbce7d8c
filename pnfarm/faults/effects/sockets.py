"""A drive's streams, as injections see them: closed from the drive's end, refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.faults.effects.parts import DrivePart, Part

if TYPE_CHECKING:
    from pnfarm.faults.gate.socket_gate import SocketGate

__all__ = ["SOCKETS", "Sockets"]


class Sockets(DrivePart):
    """``port`` is the drive's port of the link.  What is in force here, its wire shows."""

    def __init__(self, gate: SocketGate, port: int) -> None:
        self._gate = gate
        self._port = port

    def sessions(self) -> list[int]:
        """Streams on which the drive has answered; a number is never used again."""
        return self._gate.sessions(self._port)

    def close(self, stream: int, now: int) -> None:
        """Close one from the drive's end."""
        self._gate.cut(self._port, stream, now)

    def refuse(self) -> None:
        """Refuse every new stream until each caller has called :meth:`accept`."""
        self._gate.refuse(self._port, on=True)

    def accept(self) -> None:
        """Undo one :meth:`refuse`."""
        self._gate.refuse(self._port, on=False)


SOCKETS: Part[Sockets] = Part("streams of its own")
