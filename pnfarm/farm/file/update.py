"""A farm file that its user has edited, brought up to date with what an import makes now.

Three texts are compared value by value: the user's, the one that the import made the last time (the base), and the one
that it makes now.  What differs between the last two is the project's change, and made in the user's text unless the
user has changed the same value.  Without a base the keys that the import makes now are the project's, all others the
user's.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.config.drive import MAX_DRIVES
from pnfarm.config.values import expand_name
from pnfarm.errors import ConfigError
from pnfarm.vocabulary.quoting import shortened, shown
from pnfarm.vocabulary.yaml_edits import Part, UneditableError, YamlEditor, parts_of
from pnfarm.vocabulary.yaml_lines import parse_yaml

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from pnfarm.vocabulary.yaml_lines import Node

__all__ = ["Project", "Updated", "update"]

#: Lists of stations.
_LISTS = ("drives", "devices")


@dataclass(frozen=True, slots=True)
class Project:
    """What an import found: ``text`` is the farm file made of it, ``source`` the file's name.

    ``addresses``: keys whose values no two stations share; ``unplayed``: why stations that it has are not in ``text``.
    """

    text: str
    source: str
    addresses: Collection[str]
    unplayed: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Updated:
    """The text, and a sentence for each station of which there is something to say."""

    text: str
    sentences: list[str]


def update(text: str, base: str | None, project: Project) -> Updated:
    """The user's ``text`` with what the project changed since ``base``; all texts have the same ends of lines.

    Raises :class:`YamlError` where a text is not YAML, :class:`ConfigError` where it cannot be changed.
    """
    merge = _Merge(text, base, project)
    merge.top()
    for key in _LISTS:
        merge.stations(key)
    merge.comments()
    try:
        made = merge.editor.result()
    except UneditableError as error:
        raise ConfigError(f"nothing is changed: {error.why}; --force replaces the file") from error
    return Updated(made, [f"{name}: {'; '.join(said)}" for name, said in merge.said.items()])


class _Merge:
    def __init__(self, text: str, base: str | None, project: Project) -> None:
        self.editor = YamlEditor(text)
        self.text, self.base_text, self.project = text, base, project
        self.root = self.editor.root
        self.user = self.editor.parts(self.root)
        self.base = {} if base is None else parts_of(base, parse_yaml(base).root)
        self.made = parts_of(project.text, parse_yaml(project.text).root)
        self.said: dict[str, list[str]] = {}
        self._changed: list[str] = []
        #: Groups of the user by the names of their stations, with their lists.
        self._owners = {
            name: (key, group)
            for key in _LISTS
            for group, part in self._groups(key).items()
            for name in _members(part.plain)
        }

    def _groups(self, key: str) -> dict[str, Part]:
        return self.editor.parts(self.user[key].value) if key in self.user else {}

    # -- what is said ------------------------------------------------------------------------------------------------

    def _say(self, station: str, sentence: str) -> None:
        self.said.setdefault(station, []).append(sentence)

    def _say_changes(self, station: str) -> None:
        if self._changed:
            self.said.setdefault(station, []).insert(0, f"changed: {', '.join(self._changed)}")
            self._changed = []

    def _by_hand(self, station: str, line: int, what: str, why: str) -> None:
        self._say(station, f"line {line}: {what}: change it by hand, because {why}")

    def _try(self, station: str, paths: Sequence[str], line: int, what: str, change: Callable[[], None]) -> None:
        try:
            change()
        except UneditableError as error:
            self._by_hand(station, error.line or line, f"{', '.join(paths)}: {what}", error.why)
        else:
            self._changed += paths

    def _mentions(self, name: str, besides: Part) -> str:
        """Other lines with a station's name, which may mean it."""
        word = re.compile(rf"(?<![\w-]){re.escape(name)}(?![\w-])")
        last = besides.line + besides.own.count("\n")
        lines = [
            str(number)
            for number, line in enumerate(self.text.split("\n"), 1)
            if not besides.line <= number <= last and not line.lstrip().startswith("#") and word.search(line)
        ]
        return f", and named in line {shortened(lines)}" if lines else ""

    # -- values ------------------------------------------------------------------------------------------------------

    def top(self) -> None:
        """Keys beside the stations; they are the import's options more than the project's."""
        if self.base_text is not None:
            user, base, made = (
                {name: part for name, part in each.items() if name not in _LISTS}
                for each in (self.user, self.base, self.made)
            )
            self._inside("the farm", "", self.root, user, base, made)
            self._say_changes("the farm")

    def _inside(
        self, station: str, place: str, holder: Node, user: Mapping[str, Part], base: Mapping[str, Part],
        made: Mapping[str, Part],
    ) -> None:  # fmt: skip
        """Merge what a mapping, or a list with names, holds."""
        if self.base_text is None:
            base = {name: user[name] for name in made if name in user}
        gone: list[str] = []
        added: list[str] = []
        for name in {**base, **made}:
            own, was, now = user.get(name), base.get(name), made.get(name)
            path = self._path(place, name)
            if (was and now and was.plain == now.plain) or (own and now and own.plain == now.plain):
                continue
            if own is None:
                if was is None:
                    added.append(name)
                elif now is not None:
                    # the user's name for it, or one more
                    alike = [f"{one} (line {part.line})" for one, part in user.items() if part.plain == was.plain]
                    named = f" or named it {shortened(alike)}" if alike else ""
                    self._say(station, f"{path}: you removed it{named}; the project has {_value(now)} now")
            elif now is None:
                if was is not None and _all_of(own, was):
                    gone.append(name)
                elif was is not None and own.parts and was.parts:
                    self._inside(station, path, own.value, own.parts, was.parts, {})
                else:
                    self._say(station, f"line {own.line}: {path} {_value(own)} is kept; the project has it no more")
            else:
                self._change(station, path, holder, name, own, was, now)
        ends = set(gone) >= set(user)
        if ends and gone and not added:
            self._by_hand(station, user[gone[0]].line, f"{place}: the project has none", "nothing would be left there")
            return
        after = None
        for name in made:
            if name in added:
                add = partial(self.editor.add, holder, name, made[name], after, first=ends)
                what = f"the project has {_value(made[name])} now"
                self._try(station, [self._path(place, name)], holder.line, what, add)
            elif name in user and name not in gone:
                after = name
        if gone:
            known = [name for name in gone if user[name].own == base[name].own]
            remove = partial(self.editor.remove, holder, gone, known)
            paths = [self._path(place, name) for name in gone]
            self._try(station, paths, user[gone[0]].line, "the project has it no more", remove)

    @staticmethod
    def _path(place: str, name: str) -> str:
        return f"{place}.{name}" if place else name

    def _change(self, station: str, path: str, holder: Node, name: str, own: Part, was: Part | None, now: Part) -> None:
        """What the project added or changed, and the file has."""
        as_made = self.base_text is not None and was is not None and _untouched(own, was)
        if not as_made and own.parts and now.parts and (was is None or was.parts):
            self._inside(station, path, own.value, own.parts, {} if was is None else was.parts, now.parts)
        elif as_made or (was is not None and own.plain == was.plain):
            replace = partial(self.editor.replace, holder, name, now, known=as_made)
            self._try(station, [path], own.line, f"the project has {_value(now)} now", replace)
        else:
            self._say(station, f"line {own.line}: {path} {_value(own)} is kept; the project has {_value(now)} now")

    # -- stations ----------------------------------------------------------------------------------------------------

    def stations(self, key: str) -> None:
        """Merge a list of stations."""
        user = self._groups(key)
        base, made = (each[key].parts if key in each else {} for each in (self.base, self.made))
        if key in self.user and not user:
            self._by_hand(key, self.user[key].line, "groups", "two of them have the same name")
            return
        if self.base_text is None:
            base = {}
        pairs: list[tuple[str, str | None, str | None]] = []
        free = {name: part for name, part in user.items() if name not in base and not _is_pattern(part)}
        fresh = {name: part for name, part in made.items() if name not in base}
        for name, was in base.items():
            own = group if (group := self._group_of(key, name)) is not None else self._alike(was, free)
            now = name if name in made else self._alike(was, fresh)
            free.pop(own or "", None)
            fresh.pop(now or "", None)
            pairs.append((name, own, now))
        if self.base_text is None:
            for name, now_part in made.items():
                own = group if (group := self._group_of(key, name)) is not None else self._alike(now_part, free)
                if own is not None:
                    free.pop(own, None)
                    fresh.pop(name)
                    pairs.append((name, own, name))
        fresh = self._not_own(fresh, {own for _, own, _ in pairs})
        going = [(name, own) for name, own, now in pairs if own is not None and now is None]
        going = [(name, own) for name, own in going if not self._stays(key, name, own)]
        if going and len(going) == len(user) and not fresh:
            self._end(key, [own for _, own in going])
            going = []
        for name, own, now in pairs:
            if own is None:
                if now is not None:
                    self._say(name, "you removed it, and it is not added again")
            elif now is None:
                if (name, own) in going:
                    self._go(key, own, base[name])
            else:
                self._both(key, own, base.get(name), made[now])
        self._add(key, fresh, {now: own for _, own, now in pairs if own is not None and now is not None})
        if self.base_text is None:
            for name in free:
                self._say(name, "kept; the project has no such station")

    def _group_of(self, key: str, name: str) -> str | None:
        of, group = self._owners.get(name, (key, None))
        return group if of == key else None

    def _alike(self, part: Part, among: Mapping[str, Part]) -> str | None:
        """The only station with one of its addresses."""
        mine = part.plain
        found = {
            name
            for name, other in among.items()
            for key in self.project.addresses
            if mine.get(key) is not None and mine[key] == other.plain.get(key)
        }
        return found.pop() if len(found) == 1 else None

    def _not_own(self, fresh: Mapping[str, Part], paired: Collection[str | None]) -> dict[str, Part]:
        """The project's new stations without those that the user has already, under their names or addresses."""
        others = {
            group: part
            for key in _LISTS
            for group, part in self._groups(key).items()
            if group not in paired and not (key in self.base and group in self.base[key].parts)
        }
        found: dict[str, Part] = {}
        for name, now in fresh.items():
            _, own = self._owners.get(name, ("", None))
            if own is None or own not in others:
                own = self._alike(now, others)
            if own is None:
                found[name] = now
                continue
            what = "name" if own == name else "address"
            place = f"line {others[own].line}: your own {own}"
            self._say(name, f"new in the project; {place} has its {what} and is kept as it is")
        return found

    def _stays(self, key: str, name: str, own: str) -> bool:
        """Whether the file keeps a station that the project does not have, or that cannot be made now."""
        part = self._groups(key)[own]
        if name in self.project.unplayed:
            self._say(own, f"kept; the project has it, but it cannot be made now: {self.project.unplayed[name]}")
            return True
        if _is_pattern(part):
            self._by_hand(name, part.line, "the project has it no more", f"it is one of {own}")
            return True
        return False

    def _end(self, key: str, going: Collection[str]) -> None:
        """No station of a list is left."""
        part, how = self.user[key], "made a comment"
        try:
            if _untouched(part, self.base[key]):
                self.editor.remove(self.root, [key], [key])
                how = "removed, as you had changed nothing in it"
            else:
                self.editor.comment_out(self.root, key, self._why())
        except UneditableError as error:
            self._by_hand(key, error.line or part.line, "the project has none of them", error.why)
            return
        for name in going:
            self._say(name, f"gone from the project: {how}{self._mentions(name, part)}")

    def _why(self) -> str:
        return f"gone from {self.project.source}; without these marks it is in the farm again:"

    def _go(self, key: str, own: str, was: Part) -> None:
        holder, part = self.user[key].value, self._groups(key)[own]
        try:
            if _untouched(part, was):
                self.editor.remove(holder, [own], [own])
                self._swap_comments(key, part, was.comments, "")
                how = "removed, as you had changed nothing in it"
            else:
                self.editor.comment_out(holder, own, self._why())
                how = "made a comment"
        except UneditableError as error:
            self._by_hand(own, error.line or part.line, "the project has it no more", error.why)
            return
        self._say(own, f"gone from the project: {how}{self._mentions(own, part)}")

    def _both(self, key: str, own: str, was: Part | None, now: Part) -> None:
        holder, part = self.user[key].value, self._groups(key)[own]
        if _is_pattern(part):
            keys = () if was is None else [each for each in now.parts if _plain(was, each) != _plain(now, each)]
            if keys:
                name = str(now.plain["name"])
                what = ", ".join(f"{each} of the project is {_value(now.parts[each])} now" for each in keys)
                self._by_hand(name, part.line, what, f"it is one of {own}")
            return
        if was is not None and _untouched(part, was) and was.plain != now.plain:
            keys = [each for each in {**was.parts, **now.parts} if _plain(was, each) != _plain(now, each)]
            replace = partial(self.editor.replace, holder, own, now, known=True)
            self._try(own, keys, part.line, "changed in the project", replace)
        else:
            parts = now.parts
            if was is None:
                # a name that differs may be the user's: others of the file may say it
                parts = {each: one for each, one in parts.items() if each != "name"}
            self._inside(own, "", part.value, part.parts, {} if was is None else was.parts, parts)
        renamed = "name" in self._changed
        self._say_changes(own)
        if renamed:
            self._say(own, f"its name is {now.plain['name']} now{self._mentions(own, part)}")
        if was is not None and was.comments != now.comments:
            self._swap_comments(key, part, was.comments, now.comments)

    def _add(self, key: str, fresh: Mapping[str, Part], spots: dict[str, str]) -> None:
        """Add new stations, each behind the one that it is behind in the project."""
        made = list(self.made[key].parts) if key in self.made else []
        if fresh and key not in self.user:
            newline = "\r\n" if "\r\n" in self.text else "\n"
            text = newline.join([f"{key}:", *(part.block(2) for part in fresh.values()), ""])
            whole = parts_of(text, parse_yaml(text).root)[key]
            others = [
                each for each in (*(one for one in self.made if one not in _LISTS), "drives") if each in self.user
            ]
            self._add_one(key, self.root, key, whole, others[-1] if others else None)
        elif fresh:
            for place, name in enumerate(made):
                if name in fresh:
                    before = [spots[one] for one in made[:place] if one in spots]
                    self._add_one(name, self.user[key].value, name, fresh[name], before[-1] if before else None)
        for name in fresh:
            if name not in self.said and key not in self.said:
                self._say(name, "added")

    def _add_one(self, station: str, holder: Node, name: str, part: Part, after: str | None) -> None:
        try:
            self.editor.add(holder, name, part, after, first=after is None and holder is not self.root)
        except UneditableError as error:
            self._by_hand(station, error.line, f"new in the project: {part.inline()}", error.why)

    # -- comments ----------------------------------------------------------------------------------------------------

    def _swap_comments(self, key: str, part: Part, old: str, new: str) -> None:
        """Those of the import above a station, unless the user has edited them."""
        before = [one.value.end for one in self._groups(key).values() if one.start < part.start]
        low = max(before, default=self.user[key].start)
        if old:
            self.editor.swap(old, new, low, part.start)
        else:
            self.editor.add_lines(part.start - part.column, new.removesuffix("\n"))

    def comments(self) -> None:
        """Those above and below all values."""
        if self.base_text is None:
            return
        made = self.project.text
        for old, new in zip(_around(self.base_text, self.base), _around(made, self.made), strict=True):
            if old == new:
                continue
            if old:
                self.editor.swap(old, new, 0, len(self.text))
            else:
                self.editor.add_lines(len(self.text), new.removesuffix("\n"))


def _around(text: str, parts: Mapping[str, Part]) -> tuple[str, str]:
    """The lines above and below all values."""
    first = min(one.start for one in parts.values())
    last = max(one.start + len(one.own.rstrip()) for one in parts.values())
    return text[:first], text[text.find("\n", last) + 1 or len(text) :]


def _plain(part: Part, key: str) -> Any:
    return part.plain.get(key)


def _value(part: Part) -> str:
    return shown(part.plain)


def _untouched(own: Part, was: Part) -> bool:
    """Whether a value is written as the import did."""
    return own.own == was.own and (own.column == was.column or "\n" not in own.own) and own.flow == was.flow


def _all_of(own: Part, was: Part) -> bool:
    """Whether a value has nothing that the import did not write."""
    inside, known = own.parts, was.parts
    if inside and known:
        return all(name in known and _all_of(one, known[name]) for name, one in inside.items())
    return bool(own.plain == was.plain)


def _members(group: Mapping[str, Any]) -> list[str]:
    """The names of a group's stations."""
    count, start = (group.get(key, 1) for key in ("count", "start"))
    if not (isinstance(count, int) and isinstance(start, int) and 0 < count <= MAX_DRIVES):
        return [str(group["name"])]
    return [expand_name(str(group["name"]), start + step) for step in range(count)]


def _is_pattern(part: Part) -> bool:
    return _members(part.plain) != [part.plain["name"]]
