"""``devices:``: the files of their makers, read and plugged together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.farm.file.choice import device_part

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pnfarm.config.device import DeviceGroup
    from pnfarm.vocabulary.issues import Report

__all__ = ["with_descriptions"]


def with_descriptions(
    groups: Sequence[DeviceGroup], folder: Path, report: Report, places: Sequence[int] | None = None
) -> list[DeviceGroup]:
    """The groups with what their files, relative to ``folder``, say; what is wrong there is reported.

    ``places`` are the numbers that the groups have in the file, in their order if it is left out.
    """
    numbers = range(len(groups)) if places is None else places
    return [
        device_part(group).describe(("devices", number), group, folder, report)
        for number, group in zip(numbers, groups, strict=True)
    ]
