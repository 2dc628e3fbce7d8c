"""What all sections of the farm file have in common."""

from __future__ import annotations

from typing import ClassVar

from pydantic import BaseModel, ConfigDict

__all__ = ["Section"]


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
