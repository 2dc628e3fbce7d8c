"""Values of three texts of one file: the user's changes stay, those between the two others are made in the user's."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING

from pnfarm.vocabulary.quoting import shortened, shown
from pnfarm.vocabulary.yaml_edits import UneditableError, YamlEditor
from pnfarm.vocabulary.yaml_parts import in_flow_style

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from pnfarm.vocabulary.yaml_lines import Node
    from pnfarm.vocabulary.yaml_parts import Part

__all__ = ["Merging", "as_written", "brief"]

_NO_MORE = "the project has it no more"


class Merging:
    """One merge into the user's text, and what there is to say of it, by stations.

    Without a base (``has_base``), what the project has is its own, also where the user has changed it.
    """

    def __init__(self, text: str, *, has_base: bool) -> None:
        self.editor = YamlEditor(text)
        self.said: dict[str, list[str]] = {}
        self._has_base = has_base
        self._lines: dict[str, list[int]] = {}
        for number, line in enumerate(text.split("\n"), 1):
            for word in set(re.findall(r"[\w-]+", line)) if not line.lstrip().startswith("#") else ():
                self._lines.setdefault(word, []).append(number)

    # -- what is said ------------------------------------------------------------------------------------------------

    def say(self, station: str, sentence: str) -> None:
        """Say something of a station."""
        self.said.setdefault(station, []).append(sentence)

    def by_hand(self, station: str, line: int, what: str, why: str) -> None:
        """Say what is left to the user."""
        self.say(station, f"line {line}: {what}: change it by hand, because {why}")

    def mentions(self, name: str, besides: Part) -> str:
        """Other lines with the first word of a station's name, which may mean it."""
        own = range(besides.line, besides.line + besides.own.count("\n") + 1)
        lines = [str(one) for one in self._lines.get(name.partition(".")[0], ()) if one not in own]
        return f" (its name is also in line {shortened(lines)})" if lines else ""

    def attempt(
        self, station: str, paths: Sequence[str], line: int, what: str, change: Callable[[], None]
    ) -> list[str]:
        """Make a change of the values of these paths, or say what is to be done by hand; the paths, if it is made."""
        try:
            change()
        except UneditableError as error:
            self.by_hand(station, error.line or line, f"{', '.join(paths)}: {what}", error.why)
            return []
        return list(paths)

    # -- values ------------------------------------------------------------------------------------------------------

    def merge(
        self, station: str, holder: Node, user: Mapping[str, Part], base: Mapping[str, Part], made: Mapping[str, Part],
        place: str = "",
    ) -> list[str]:  # fmt: skip
        """Merge parts of ``holder`` in the user's text, and say what is kept; the paths of those that changed."""
        if not self._has_base:
            base = {name: user[name] for name in made if name in user}
        paths = {name: f"{place}.{name}" if place else name for name in {**base, **made}}
        gone: list[str] = []
        added: list[str] = []
        changed: list[str] = []
        for name, path in paths.items():
            own, was, now = user.get(name), base.get(name), made.get(name)
            if (was and now and was.plain == now.plain) or (own and now and own.plain == now.plain):
                continue
            if own is None:
                if was is None:
                    added.append(name)
                elif now is not None:
                    # the user's name for it, or one more
                    alike = [f"{one} (line {part.line})" for one, part in user.items() if part.plain == was.plain]
                    named = f" or named it {shortened(alike)}" if alike else ""
                    self.say(station, f"{path}: you removed it{named}; the project has {brief(now)} now")
            elif now is not None:
                changed += self._change(station, path, holder, name, own, was, now)
            elif was is not None and _has_no_more(own, was):
                gone.append(name)
            elif was is not None and not place and own.key and own.parts and was.parts:
                # a key of a station, such as signals; further in, what the user added belongs to what would go
                changed += self.merge(station, own.value, own.parts, was.parts, {}, path)
            else:
                self.say(station, f"line {own.line}: {path} {brief(own)} is kept; {_NO_MORE}")
        return changed + self._add_and_remove(station, holder, user, base, made, paths, added, gone)

    def _change(
        self, station: str, path: str, holder: Node, name: str, own: Part, was: Part | None, now: Part
    ) -> list[str]:
        """What the project added or changed, and the file has."""
        known = self._has_base and was is not None and as_written(own, was)
        if not known and own.parts and now.parts and (was is None or was.parts):
            return self.merge(station, own.value, own.parts, {} if was is None else was.parts, now.parts, path)
        what = f"the project has {brief(now)} now"
        if known or (was is not None and own.plain == was.plain):
            replace = partial(self.editor.replace, holder, name, now, known=known)
            return self.attempt(station, [path], own.line, what, replace)
        self.say(station, f"line {own.line}: {path} {brief(own)} is kept; {what}")
        return []

    def _add_and_remove(
        self, station: str, holder: Node, user: Mapping[str, Part], base: Mapping[str, Part], made: Mapping[str, Part],
        paths: Mapping[str, str], added: Sequence[str], gone: Sequence[str],
    ) -> list[str]:  # fmt: skip
        ends = set(gone) >= set(user)
        if ends and gone and not added:
            self.by_hand(station, user[gone[0]].line, f"{paths[gone[0]]}: {_NO_MORE}", "nothing would be left there")
            return []
        changed: list[str] = []
        after = None
        for name in made:
            if name in added:
                add = partial(self.editor.add, holder, name, made[name], after, first=ends)
                what = f"the project has {brief(made[name])} now"
                changed += self.attempt(station, [paths[name]], holder.line, what, add)
            elif name in user and name not in gone:
                after = name
        if gone:
            known = [name for name in gone if user[name].own == base[name].own]
            remove = partial(self.editor.remove, holder, gone, known)
            changed += self.attempt(station, [paths[name] for name in gone], user[gone[0]].line, _NO_MORE, remove)
        return changed


def brief(part: Part) -> str:
    """A value as a message quotes it."""
    plain = part.plain
    return shown(" ".join(in_flow_style(part.text, part.value).split()) if isinstance(plain, dict | list) else plain)


def as_written(own: Part, was: Part) -> bool:
    """Whether the user's value is written as in the base."""
    return own.own == was.own and (own.column == was.column or "\n" not in own.own) and own.flow == was.flow


def _has_no_more(own: Part, was: Part) -> bool:
    """Whether the user's value has nothing that is not in the base."""
    inside, known = own.parts, was.parts
    if inside and known:
        return all(name in known and _has_no_more(one, known[name]) for name, one in inside.items())
    return bool(own.plain == was.plain)
