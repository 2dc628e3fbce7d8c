"""A plant as a picture (SVG): what gives on the left, models in the middle, what takes on the right."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from pnfarm.plant.plan import StationEnd

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from pnfarm.plant.plan import PlantPlan

__all__ = ["plant_picture"]

#: Pixels: height of a line of text, width of a box, of the room between columns, of the edge.
_LINE, _BOX, _GAP, _EDGE = 18, 220, 160, 20
_HEAD = 24


class _Box:
    """A station or a model: its title, and its ports with the side at which wires meet them."""

    def __init__(self, title: str, subtitle: str, column: int) -> None:
        self.title, self.subtitle, self.column = title, subtitle, column
        self.left: list[str] = []
        self.right: list[str] = []
        self.top = 0

    @property
    def height(self) -> int:
        return _HEAD + _LINE * max(len(self.left), len(self.right), 1) + 8

    @property
    def x(self) -> int:
        return _EDGE + self.column * (_BOX + _GAP)

    def place(self, port: str, *, right: bool) -> tuple[int, int]:
        """Where a wire meets a port."""
        row = (self.right if right else self.left).index(port)
        return self.x + (_BOX if right else 0), self.top + _HEAD + _LINE * row + _LINE // 2


def plant_picture(plan: PlantPlan) -> str:
    """The SVG text."""
    models = {name: _Box(name, model.kinds[0], 1) for name, model in plan.models.items()}
    for name, model in plan.models.items():
        models[name].left, models[name].right = list(model.inputs), list(model.outputs)
    owners = {number: (name, port) for name, model in plan.models.items() for port, number in _numbers(model.inputs)}
    owners |= {number: (name, port) for name, model in plan.models.items() for port, number in _numbers(model.outputs)}
    givers: dict[str, _Box] = {}
    takers: dict[str, _Box] = {}
    lines = []
    for wire in plan.wires:
        ends = []
        for end, boxes, right in ((wire.source, givers, True), (wire.target, takers, False)):
            if isinstance(end, StationEnd):
                box = boxes.setdefault(end.station, _Box(end.station, "", 0 if right else 2))
                ports = box.right if right else box.left
                if end.signal not in ports:
                    ports.append(end.signal)
                ends.append((box, end.signal, right))
            else:
                name, port = owners[end]
                ends.append((models[name], port, port in models[name].right))
        lines.append((wire.text.text, ends))
    columns: Sequence[Mapping[str, _Box]] = (givers, models, takers)
    height = max(_stack(column.values()) for column in columns)
    width = 2 * _EDGE + 3 * _BOX + 2 * _GAP
    size = f'width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="12">',
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
    ]
    for text, ((first, begin, right), (second, target, behind)) in lines:
        x1, y1 = first.place(begin, right=right)
        x2, y2 = second.place(target, right=behind)
        bend = max(40, abs(x2 - x1) // 2)
        parts.append(
            f'<path d="M {x1} {y1} C {x1 + bend} {y1} {x2 - bend} {y2} {x2} {y2}" fill="none" stroke="#3b6ea5">'
            f"<title>{escape(text)}</title></path>"
        )
    for column in columns:
        for box in column.values():
            parts += _drawn(box)
    return "\n".join([*parts, "</svg>", ""])


def _numbers(ports: Mapping[str, tuple[object, int]]) -> list[tuple[str, int]]:
    return [(name, number) for name, (_, number) in ports.items()]


def _stack(boxes: Iterable[_Box]) -> int:
    """Put the boxes of a column below each other; where they end."""
    top = _EDGE
    for box in boxes:
        box.top = top
        top += box.height + _EDGE
    return top


def _drawn(box: _Box) -> list[str]:
    x, y = box.x, box.top
    title = escape(box.title) + (f' <tspan fill="#777777">{escape(box.subtitle)}</tspan>' if box.subtitle else "")
    found = [
        f'<rect x="{x}" y="{y}" width="{_BOX}" height="{box.height}" rx="4" fill="#f4f6f8" stroke="#8a97a5"/>',
        f'<text x="{x + 8}" y="{y + 16}" font-weight="bold">{title}</text>',
    ]
    for ports, anchor, place in ((box.left, "start", x + 8), (box.right, "end", x + _BOX - 8)):
        found += [
            f'<text x="{place}" y="{y + _HEAD + _LINE * row + 13}" text-anchor="{anchor}">{escape(port)}</text>'
            for row, port in enumerate(ports)
        ]
    return found
