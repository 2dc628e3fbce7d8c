"""A farm file that its user has edited, brought up to date with what an import makes now.

Three texts are compared value by value: the user's, the one that the import made the last time (the base), and the one
that it makes now.  What differs between the last two is the project's change, and made in the user's text unless the
user has changed the same value.  Without a base the keys that the import makes now are the project's, all others the
user's.  Stations are the same by their names, or else by an address.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from pnfarm.config.drive import MAX_DRIVES
from pnfarm.config.values import expand_name
from pnfarm.errors import ConfigError
from pnfarm.farm.file.merging import Merging, as_written, brief
from pnfarm.vocabulary.yaml_edits import UneditableError
from pnfarm.vocabulary.yaml_lines import parse_yaml
from pnfarm.vocabulary.yaml_parts import next_line, parts_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from pnfarm.vocabulary.yaml_lines import Node
    from pnfarm.vocabulary.yaml_parts import Part

__all__ = ["Project", "Updated", "update"]

#: Lists of stations.
_LISTS = ("drives", "devices")
_REMOVED, _COMMENTED = "removed, as you had changed nothing in it", "made a comment"


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


@dataclass(frozen=True, slots=True)
class _Pair:
    """A station of the base, or without one of the project, as the user's group and the project's station."""

    name: str
    own: str | None
    now: str | None


def update(text: str, base: str | None, project: Project) -> Updated:
    """The user's ``text`` with what the project changed since ``base``; all texts have the same ends of lines.

    Raises :class:`YamlError` where a text is not YAML, :class:`ConfigError` where it cannot be changed.
    """
    update = _Update(text, base, project)
    update.options()
    for key in _LISTS:
        update.stations(key)
    update.comments()
    try:
        made = update.merging.editor.result()
    except UneditableError as error:
        raise ConfigError(f"nothing is changed: {error.why}; --force replaces the file") from error
    return Updated(made, [f"{name}: {'; '.join(said)}" for name, said in update.merging.said.items()])


class _Update:
    def __init__(self, text: str, base: str | None, project: Project) -> None:
        self.merging = Merging(text, has_base=base is not None)
        self.editor = self.merging.editor
        self.text, self.base_text, self.project = text, base, project
        self.user = self.editor.parts(self.editor.root)
        self.base = {} if base is None else parts_of(base, parse_yaml(base).root)
        self.made = parts_of(project.text, parse_yaml(project.text).root)
        #: The user's groups by the names of their stations, with their lists.
        self._owners = {
            name: (key, group)
            for key in _LISTS
            for group, part in self._groups(key).items()
            for name in _members(part.plain)
        }

    def _groups(self, key: str) -> dict[str, Part]:
        return self.editor.parts(self.user[key].value) if _has_groups(self.user, key) else {}

    def options(self) -> None:
        """Merge the keys beside the stations; they are the import's options more than the project's."""
        if self.base_text is None:
            return
        user, base, made = (
            {name: part for name, part in each.items() if name not in _LISTS}
            for each in (self.user, self.base, self.made)
        )
        farm = "the farm"
        self._say_changed(farm, self.merging.merge(farm, self.editor.root, user, base, made))

    def _say_changed(self, station: str, changed: Iterable[str]) -> None:
        if changed:
            self.merging.said.setdefault(station, []).insert(0, f"changed: {', '.join(changed)}")

    # -- which station is which --------------------------------------------------------------------------------------

    def stations(self, key: str) -> None:
        """Merge a list of stations."""
        user = self._groups(key)
        base, made = (each[key].parts if _has_groups(each, key) else {} for each in (self.base, self.made))
        if key in self.user and not user:
            self.merging.by_hand(key, self.user[key].line, "its groups", "two of them have the same name")
            return
        free = {name: part for name, part in user.items() if name not in base and not _is_pattern(part)}
        fresh = {name: part for name, part in made.items() if name not in base}
        pairs: list[_Pair] = []
        for name, part in (made if self.base_text is None else base).items():
            own = self._own(key, name, part, free)
            now = name if name in made else self._alike(part, fresh)
            if self.base_text is not None or own is not None:
                pairs.append(_Pair(name, own, now))
                free.pop(own or "", None)
                fresh.pop(now or "", None)
        fresh = self._not_own(fresh, {one.own for one in pairs})
        going = {one.name: one.own for one in pairs if one.own and not one.now and not self._stays(key, one)}
        if going and len(going) == len(user) and not fresh:
            self._end(key, going.values())
            going = {}
        for one in pairs:
            if one.now is not None and one.own is not None:
                self._both(key, one.own, base.get(one.name), made[one.now])
            elif one.now is not None:
                self.merging.say(one.name, "you removed it, and it is not added again")
            elif one.own is not None and one.name in going:
                self._go(key, one.own, base[one.name])
        self._add(key, fresh, {one.now: one.own for one in pairs if one.now and one.own})
        for name in free if self.base_text is None else ():
            self.merging.say(name, "kept; the project has no such station")

    def _own(self, key: str, name: str, part: Part, free: Mapping[str, Part]) -> str | None:
        """The user's group of a station: it has its name, or one of its addresses."""
        of, group = self._owners.get(name, (key, None))
        return group if group is not None and of == key else self._alike(part, free)

    def _alike(self, part: Part, among: Mapping[str, Part]) -> str | None:
        """The only station with one of its addresses."""
        mine = part.plain
        addresses = {key: mine[key] for key in self.project.addresses if mine.get(key) is not None}
        found = {
            name
            for name, other in among.items()
            for key, value in addresses.items()
            if key in other.parts and other.parts[key].plain == value
        }
        return found.pop() if len(found) == 1 else None

    def _not_own(self, fresh: Mapping[str, Part], paired: Collection[str | None]) -> dict[str, Part]:
        """The project's new stations without those that the user has already, under their names or addresses."""
        others: dict[str, Part] = {}
        for key in _LISTS:
            known = {*paired, *(self.base[key].parts if _has_groups(self.base, key) else ())}
            others |= {group: part for group, part in self._groups(key).items() if group not in known}
        found: dict[str, Part] = {}
        for name, now in fresh.items():
            _, own = self._owners.get(name, ("", None))
            if own is None or own not in others:
                own = self._alike(now, others)
            if own is None:
                found[name] = now
            else:
                place = f"line {others[own].line}: your own {own}"
                what = "address" if own != name else "name"
                self.merging.say(name, f"new in the project; {place} has its {what} and is kept as it is")
        return found

    def _stays(self, key: str, pair: _Pair) -> bool:
        """Whether the file keeps a station that the project does not have, or that cannot be made now."""
        own = pair.own or ""
        part = self._groups(key)[own]
        if pair.name in self.project.unplayed:
            why = self.project.unplayed[pair.name]
            self.merging.say(own, f"kept; the project has it, but it cannot be made now: {why}")
            return True
        if _is_pattern(part):
            self.merging.by_hand(pair.name, part.line, "the project has it no more", f"it is one of {own}")
            return True
        return False

    # -- changes -----------------------------------------------------------------------------------------------------

    def _both(self, key: str, own: str, was: Part | None, now: Part) -> None:
        part = self._groups(key)[own]
        changed = [] if was is None else _differences(was, now)
        if _is_pattern(part):
            if changed:
                what = ", ".join(
                    f"{one} of the project is {brief(now.parts[one])} now" if one in now.parts else f"{one} is gone"
                    for one in changed
                )
                self.merging.by_hand(str(now.plain["name"]), part.line, what, f"it is one of {own}")
            return
        if changed and was is not None and as_written(part, was):
            replace = partial(self.editor.replace, self.user[key].value, own, now, known=True)
            changed = self.merging.attempt(own, changed, part.line, "changed in the project", replace)
        else:
            # without a base, a name that differs may be the user's: others of the file may say it
            made = {one: each for one, each in now.parts.items() if was is not None or one != "name"}
            before = {} if was is None else was.parts
            changed = self.merging.merge(own, part.value, part.parts, before, made)
        self._say_changed(own, changed)
        if "name" in changed:
            self.merging.say(own, f"its name is {now.plain['name']} now{self.merging.mentions(own, part)}")
        if was is not None and was.comments != now.comments:
            self._swap_comments(key, part, was.comments, now.comments)

    def _end(self, key: str, going: Collection[str | None]) -> None:
        """No station of a list is left."""
        part, how = self.user[key], _COMMENTED
        try:
            if as_written(part, self.base[key]):
                self.editor.remove(self.editor.root, [key], [key])
                how = _REMOVED
            else:
                self.editor.comment_out(self.editor.root, key, self._why())
        except UneditableError as error:
            self.merging.by_hand(key, error.line or part.line, "the project has none of them", error.why)
            return
        for name in going:
            self.merging.say(f"{name}", f"gone from the project: {how}{self.merging.mentions(f'{name}', part)}")

    def _why(self) -> str:
        return f"gone from {self.project.source}; without these marks it is in the farm again:"

    def _go(self, key: str, own: str, was: Part) -> None:
        holder, part, how = self.user[key].value, self._groups(key)[own], _COMMENTED
        try:
            if as_written(part, was):
                self.editor.remove(holder, [own], [own])
                self._swap_comments(key, part, was.comments, "")
                how = _REMOVED
            else:
                self.editor.comment_out(holder, own, self._why())
        except UneditableError as error:
            self.merging.by_hand(own, error.line or part.line, "the project has it no more", error.why)
        else:
            self.merging.say(own, f"gone from the project: {how}{self.merging.mentions(own, part)}")

    def _add(self, key: str, fresh: Mapping[str, Part], places: Mapping[str, str]) -> None:
        """Add new stations, each after the one that it is after in the project; ``places``: those in the file."""
        if fresh and key not in self.user:
            newline = "\r\n" if "\r\n" in self.text else "\n"
            text = newline.join([f"{key}:", *(part.block(2) for part in fresh.values()), ""])
            whole = parts_of(text, parse_yaml(text).root)[key]
            others = [one for one in (*(one for one in self.made if one not in _LISTS), *_LISTS) if one in self.user]
            if self._add_one(key, self.editor.root, key, whole, others[-1] if others else None):
                for name in fresh:
                    self.merging.say(name, "added")
            return
        after = None
        for name in self.made[key].parts if fresh else ():
            if name in fresh:
                if self._add_one(name, self.user[key].value, name, fresh[name], after):
                    self.merging.say(name, "added")
            else:
                after = places.get(name, after)

    def _add_one(self, station: str, holder: Node, name: str, part: Part, after: str | None) -> bool:
        try:
            self.editor.add(holder, name, part, after, first=after is None and holder is not self.editor.root)
        except UneditableError as error:
            self.merging.by_hand(station, error.line, f"new in the project: {part.inline()}", error.why)
            return False
        return True

    # -- comments ----------------------------------------------------------------------------------------------------

    def _swap_comments(self, key: str, part: Part, old: str, new: str) -> None:
        """Those of the import above a station, unless the user has edited them."""
        if old:
            before = [one.value.end for one in self._groups(key).values() if one.start < part.start]
            self.editor.swap(old, new, max(before, default=self.user[key].start), part.start)
        else:
            self.editor.add_lines(part.start - part.column, new.removesuffix("\n"))

    def comments(self) -> None:
        """Change those above and below all values, unless the user has edited them."""
        if self.base_text is None:
            return
        olds, news = _around(self.base_text, self.base), _around(self.project.text, self.made)
        for old, new in zip(olds, news, strict=True):
            if old and old != new:
                self.editor.swap(old, new, 0, len(self.text))
            elif old != new:
                self.editor.add_lines(len(self.text), new.removesuffix("\n"))


def _around(text: str, parts: Mapping[str, Part]) -> tuple[str, str]:
    """The lines above and below all values."""
    last = max(one.start + len(one.own.rstrip()) for one in parts.values())
    return text[: min(one.start for one in parts.values())], text[next_line(text, last) :]


def _differences(was: Part, now: Part) -> list[str]:
    before, after = was.plain, now.plain
    return [key for key in {**before, **after} if before.get(key) != after.get(key)]


def _members(group: Mapping[str, Any]) -> list[str]:
    """The names of a group's stations."""
    count, start = (group.get(key, 1) for key in ("count", "start"))
    if not (isinstance(count, int) and isinstance(start, int) and 0 < count <= MAX_DRIVES):
        return [str(group["name"])]
    return [expand_name(str(group["name"]), start + step) for step in range(count)]


def _has_groups(parts: Mapping[str, Part], key: str) -> bool:
    """Whether there is such a list: a user may have made a mapping of it."""
    return key in parts and isinstance(parts[key].plain, list)


def _is_pattern(part: Part) -> bool:
    return _members(part.plain) != [part.plain["name"]]
