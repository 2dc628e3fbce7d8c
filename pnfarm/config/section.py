"""What all sections of the farm file have in common."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, PrivateAttr

__all__ = ["DescribedSection", "Section"]


class Section(BaseModel):
    """A section: known keys only, types as written, finite numbers."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)

    #: Keys that messages and editors list first and last, in this order; the others keep the order of declaration.
    first_keys: ClassVar[tuple[str, ...]] = ()
    last_keys: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def listed_keys(cls) -> list[str]:
        """The keys as a file has them, in the order in which messages and editors list them."""
        declared = [field.alias or name for name, field in cls.model_fields.items()]
        placed = {*cls.first_keys, *cls.last_keys}
        return [*cls.first_keys, *(key for key in declared if key not in placed), *cls.last_keys]


class DescribedSection(Section):
    """A section that names a maker's file."""

    _described: Any = PrivateAttr(default=None)

    def adopting(self, described: Any) -> Self:
        """The section with what its file says, in the form of its bus."""
        found = self.model_copy()
        found._described = described  # noqa: SLF001 - a copy of its own
        return found

    @property
    def described(self) -> Any:
        """What its file says, once that is read without errors; None before, and without a file."""
        return self._described
