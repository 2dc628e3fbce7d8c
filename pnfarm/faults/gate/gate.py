"""The gate between the stations and their link: acyclic frames pass it, rules lose, change or hold back some of them.

Cyclic frames do not pass here; the engine acts on them (:mod:`pnfarm.engine.channels.impair`). The gate parses no
frame: the drive's bus classifies it. Directions are seen from the drive.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable, Container
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

from pnfarm.faults.effects.evidence import Evidence
from pnfarm.faults.gate.choice import Choice, Chooser
from pnfarm.links.wrapper import LinkWrapper
from pnfarm.station.splitmix import SplitMix64

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pnfarm.faults.gate.shaping import Shape
    from pnfarm.links.base import Clock, Link, Receiver
    from pnfarm.wire.direction import Direction

__all__ = [
    "EVERY_FRAME",
    "DelayRule",
    "DueFrame",
    "FrameClass",
    "FrameClasses",
    "GateRule",
    "GatedLink",
    "LateRule",
    "Listener",
]

T = TypeVar("T")

#: Classifies a frame; the classes are the bus's: ``rpc``, ``dcp`` ...
FrameClass = Callable[[bytes], str]
#: Classes that a rule acts on.
FrameClasses = Container[str]
#: ``listener(direction, frame, now)``: hears every acyclic frame of a port, before any rule.
Listener = Callable[["Direction", bytes, int], None]


class _Every:
    """Every class there is."""

    def __contains__(self, word: object) -> bool:
        return True


EVERY_FRAME: FrameClasses = _Every()
#: Frames of one port that rules of the gate hold at most; what comes on top is lost.
MOST_WAITING = 1024


class LateRule(Protocol):
    """Decides how late a frame or answer of the drive leaves."""

    def asked(self, now: int) -> int:
        """Delay of the present one, ns; 0: in time."""

    def left(self, *, sent: bool) -> None:
        """A delayed one has left, or (``sent`` False) never will."""


@dataclass(frozen=True, slots=True, eq=False)
class DelayRule:
    """Holds back frames of ``classes`` for the time that ``late`` gives."""

    classes: FrameClasses
    late: LateRule


@dataclass(slots=True)
class _Held:
    due_ns: int
    frame: bytes
    rules: tuple[LateRule, ...]

    def left(self, *, sent: bool) -> None:
        for rule in self.rules:
            rule.left(sent=sent)


#: Time, and octets of a frame that goes on then.
DueFrame = tuple[int, bytes]


@dataclass(eq=False)
class GateRule:
    """Loses frames of ``classes``, lets something pass ``instead`` of them, or gives them another ``shape``.

    In each of ``directions``, chosen by ``choice``, without one each with ``probability``; ``count`` (0: no limit)
    altogether, of which ``spent()`` happened elsewhere; not before ``armed()`` says so, and none at or after
    ``stop_ns`` (0: no end).  ``lost()`` is called for each that is hit. Each direction has its own random sequence,
    so that they are independent.
    """

    directions: Sequence[Direction]
    classes: FrameClasses = EVERY_FRAME
    _: KW_ONLY
    probability: float = 1.0
    seed: int = 0
    count: int = 0
    stop_ns: int = 0
    armed: Callable[[], bool] = lambda: True
    spent: Callable[[], int] = lambda: 0
    lost: Callable[[], None] = lambda: None
    instead: Callable[[bytes], bytes | None] = lambda _: None
    choice: Choice | None = None
    shape: Shape | None = None
    of_messages: bool = False

    def __post_init__(self) -> None:
        #: What it takes of a stream, TCP repeats; else it takes or changes whole messages, or makes them late.
        self.is_repeated = self.shape is None and not self.of_messages
        #: Frames that the gate holds for this rule.
        self.waiting = 0
        choice = self.choice or Choice(start=self.probability)
        self._chosen = {
            direction: Chooser(choice, SplitMix64(self.seed + index)) for index, direction in enumerate(self.directions)
        }
        self._evidence = dict.fromkeys(self.directions, Evidence())

    def acts(self, direction: Direction, frame_class: str, now: int) -> bool:
        """Whether it may act on a frame of this class."""
        if direction not in self._evidence or (self.stop_ns and now >= self.stop_ns):
            return False
        return not self.exhausted and frame_class in self.classes and self.armed()

    def chooses(self, direction: Direction, now: int) -> bool:
        """Whether it acts on the present frame."""
        del now
        return self._chosen[direction]()

    def loses(self, direction: Direction, frame_class: str, now: int) -> bool:
        """Whether a frame of this class is lost, or another one passed instead. Counts the evidence."""
        if not self.acts(direction, frame_class, now):
            return False
        seen = self._evidence[direction]
        lost = self.chooses(direction, now)
        self._evidence[direction] = seen + (Evidence(1, 1, now, now, confirmed=True) if lost else Evidence(1))
        if lost:
            self.lost()
        return lost

    def left(
        self, direction: Direction, frame_class: str, frame: bytes, due: int, *, hit: bool, bare: bool = False
    ) -> list[DueFrame]:
        """What goes on instead of a frame that would at ``due``; ``bare``: octets without the headers of a frame."""
        if not hit:
            if self.shape is not None and direction in self._evidence and frame_class in self.classes:
                due = self.shape.passes(direction, due)
            return [(due, frame)]
        if self.shape is not None:
            return self.shape.hit(direction, frame, due, bare=bare)
        other = self.instead(frame)
        return [] if other is None else [(due, other)]

    def evidence(self, direction: Direction | None = None) -> Evidence:
        """Evidence of one direction, or of both."""
        if direction is not None:
            return self._evidence[direction]
        return sum(self._evidence.values(), Evidence())

    @property
    def exhausted(self) -> bool:
        """Whether ``count`` frames were lost, here and elsewhere."""
        return bool(self.count) and self.evidence().activations + self.spent() >= self.count


class GatedLink(LinkWrapper):
    """A link around ``inner``; ``clock`` stamps what is sent, received frames bring their time.

    What a port sends and a rule delays stays in order: nothing overtakes a frame that is held back.  The farm's
    runtime calls :meth:`handle_timeout` at :meth:`next_deadline`.
    """

    def __init__(self, inner: Link, clock: Clock) -> None:
        super().__init__(inner)
        self._clock = clock
        self._receiver: Receiver | None = None
        self._rules: dict[int, list[GateRule]] = {}
        self._delays: dict[int, list[DelayRule]] = {}
        self._held: dict[int, deque[_Held]] = {}
        self._classes: dict[int, FrameClass] = {}
        self._listeners: dict[int, list[Listener]] = {}
        #: Frames that a shape delays, as a heap: time, number, port, direction, octets, rule.
        self._waiting: list[tuple[int, int, int, Direction, bytes, GateRule]] = []
        self._waits: dict[int, int] = {}
        self._number = 0

    def classify(self, port: int, frame_class: FrameClass) -> None:
        """Set the port's classifier; until then its frames have no class."""
        self._classes[port] = frame_class

    def _class_of(self, port: int, frame: bytes) -> str:
        known = self._classes.get(port)
        return "" if known is None else known(frame)

    def in_force(self, port: int) -> list[object]:
        """Rules that act on a port, and frames of it that are held back."""
        waiting = [entry for entry in self._waiting if entry[2] == port]
        return [
            *self._rules.get(port, ()),
            *self._delays.get(port, ()),
            *self._held.get(port, ()),
            *self._listeners.get(port, ()),
            *waiting,
        ]

    def passes(self, port: int) -> bool:
        """Whether frames of a port pass as they are, unheard."""
        return not (
            self._waiting
            or port in self._rules
            or port in self._delays
            or port in self._held
            or port in self._listeners
        )

    @property
    def is_idle(self) -> bool:
        """Whether the frames of all ports pass as they are, unheard."""
        return not (self._waiting or self._rules or self._delays or self._held or self._listeners)

    @property
    def engaged(self) -> set[int]:
        """Ports with rules or listeners: they are to see each frame, whomever it concerns."""
        return {*self._rules, *self._delays, *self._held, *self._listeners}

    def add(self, port: int, rule: GateRule) -> None:
        self._rules[port] = [*self._rules.get(port, ()), rule]

    def remove(self, port: int, rule: GateRule) -> None:
        """Remove a rule; what it holds goes on at once.

        A frame to the drive goes on with the next :meth:`handle_timeout`, which is due now: its effects may end
        injections, and the caller is just ending one.
        """
        _remove(self._rules, port, rule)
        now = self._clock()
        for _, _, _, direction, frame, _ in self._take(lambda entry: entry[2] == port and entry[5] is rule):
            if direction == "in":
                self._wait(now, port, direction, frame, rule)
            else:
                self._go_on(port, direction, frame, now)

    def _passed(self, port: int, direction: Direction, frame: bytes, now: int) -> list[bytes]:
        """What goes on now of a frame and its copies after all rules; the rest waits."""
        # every rule sees every frame, so that its sequence does not depend on the other rules
        frame_class = self._class_of(port, frame)
        rules = [(rule, rule.loses(direction, frame_class, now)) for rule in self._rules.get(port, ())]
        left: list[DueFrame] = [(now, frame)]
        holder: GateRule | None = None
        for rule, hit in rules:
            latest = max((due for due, _ in left), default=now)
            left = [
                passing for due, octets in left for passing in rule.left(direction, frame_class, octets, due, hit=hit)
            ]
            if any(due > latest for due, _ in left):
                holder = rule
        for due, octets in left:
            if due > now and holder is not None:
                self._wait(due, port, direction, octets, holder)
        return [octets for due, octets in left if due <= now]

    def _wait(self, due: int, port: int, direction: Direction, frame: bytes, rule: GateRule) -> None:
        if self._waits.get(port, 0) >= MOST_WAITING:
            return
        self._waits[port] = self._waits.get(port, 0) + 1
        rule.waiting += 1
        self._number += 1
        heapq.heappush(self._waiting, (due, self._number, port, direction, frame, rule))

    def _take(
        self, which: Callable[[tuple[int, int, int, Direction, bytes, GateRule]], bool]
    ) -> list[tuple[int, int, int, Direction, bytes, GateRule]]:
        """Take waiting frames out, in the order of their times."""
        taken = sorted((entry for entry in self._waiting if which(entry)), key=lambda entry: entry[:2])
        if taken:
            self._waiting = [entry for entry in self._waiting if not which(entry)]
            heapq.heapify(self._waiting)
        for entry in taken:
            self._waits[entry[2]] -= 1
            entry[5].waiting -= 1
        return taken

    def _go_on(self, port: int, direction: Direction, frame: bytes, now: int) -> None:
        """After the rules."""
        if direction == "in":
            if self._receiver is not None:
                self._receiver(port, frame, now)
        elif port not in self._delays or not self._hold(port, frame, now):
            self.inner.send(port, frame)

    # a second station at the same port

    def listen(self, port: int, listener: Listener) -> None:
        """Let ``listener`` hear what the port sends and receives."""
        self._listeners[port] = [*self._listeners.get(port, ()), listener]

    def unlisten(self, port: int, listener: Listener) -> None:
        _remove(self._listeners, port, listener)

    def send_beside(self, port: int, frame: bytes) -> None:
        """Send a frame that is not the drive's: no rule acts on it."""
        self.inner.send(port, frame)

    def deliver(self, port: int, frame: bytes, now: int) -> None:
        """Hand the drive a frame of a station at its own port, which no link brings back."""
        self._receive(port, frame, now)

    # frames held back

    def delay(self, port: int, rule: DelayRule) -> None:
        self._delays[port] = [*self._delays.get(port, ()), rule]

    def undelay(self, port: int, rule: DelayRule) -> None:
        """Remove a rule; frames that no other one holds back leave at once, but for those behind one that stays."""
        _remove(self._delays, port, rule)
        standing = {other.late for other in self._delays.get(port, ())}
        staying: deque[_Held] = deque()
        for held in self._held.pop(port, ()):
            if not standing.isdisjoint(held.rules):
                staying.append(held)
            elif staying:
                held.due_ns = staying[-1].due_ns
                staying.append(held)
            else:
                self._release(port, held)
        if staying:
            self._held[port] = staying

    def forget(self, port: int) -> None:
        """Drop what is held back: its sender has lost its supply."""
        for held in self._held.pop(port, ()):
            held.left(sent=False)
        self._take(lambda entry: entry[2] == port and entry[3] == "out")

    def next_deadline(self) -> int | None:
        """When the next frame is to leave."""
        if not self._held:
            return self._waiting[0][0] if self._waiting else None
        waiting = [self._waiting[0][0]] if self._waiting else []
        return min([*waiting, *(queue[0].due_ns for queue in self._held.values())], default=None)

    def handle_timeout(self, now: int) -> None:
        if self._waiting and self._waiting[0][0] <= now:
            for _, _, port, direction, frame, _ in self._take(lambda entry: entry[0] <= now):
                self._go_on(port, direction, frame, now)
        for port, queue in list(self._held.items()):
            while queue and queue[0].due_ns <= now:
                self._release(port, queue.popleft())
            if not queue:
                self._held.pop(port, None)

    def _release(self, port: int, held: _Held) -> None:
        self.inner.send(port, held.frame)
        held.left(sent=True)

    def _hold(self, port: int, frame: bytes, now: int) -> bool:
        """Whether this frame is held back."""
        frame_class = self._class_of(port, frame)
        waits = [(rule.late, rule.late.asked(now)) for rule in self._delays[port] if frame_class in rule.classes]
        queue = self._held.get(port)
        late = sum(wait for _, wait in waits)
        if not waits or (not late and not queue):
            return False
        if queue is None:
            queue = self._held[port] = deque()
        due = max(now + late, queue[-1].due_ns if queue else 0)
        queue.append(_Held(due, frame, tuple(rule for rule, wait in waits if wait)))
        return True

    # the link

    def send(self, port_index: int, frame: bytes) -> None:
        for listener in self._listeners.get(port_index, ()):
            listener("out", frame, self._clock())
        if port_index in self._rules:
            now = self._clock()
            for left in self._passed(port_index, "out", frame, now):
                self._go_on(port_index, "out", left, now)
        elif port_index not in self._delays or not self._hold(port_index, frame, self._clock()):
            self.inner.send(port_index, frame)

    def _receive(self, port_index: int, frame: bytes, now: int) -> None:
        for listener in self._listeners.get(port_index, ()):
            listener("in", frame, now)
        if port_index in self._rules:
            for left in self._passed(port_index, "in", frame, now):
                self._go_on(port_index, "in", left, now)
        elif self._receiver is not None:
            self._receiver(port_index, frame, now)

    def set_receiver(self, receiver: Receiver) -> None:
        self._receiver = receiver
        self.inner.set_receiver(self._receive)


def _remove(of_ports: dict[int, list[T]], port: int, gone: T) -> None:
    """Out of a port's list, which is another one afterwards; ports without entries have none."""
    # bound methods are equal, and never the same object
    remaining = [other for other in of_ports.get(port, ()) if other != gone]
    if remaining:
        of_ports[port] = remaining
    else:
        of_ports.pop(port, None)
