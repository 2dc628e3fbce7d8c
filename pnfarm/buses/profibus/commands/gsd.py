"""``pnfarm gsd``: the file that an engineering tool imports for a virtual drive on PROFIBUS."""

from __future__ import annotations

from pathlib import Path

from pnfarm.terminal.description_file import FolderOption, ModelArgument, write_description

__all__ = ["gsd"]


def gsd(model: ModelArgument, directory: FolderOption = Path()) -> None:
    """Write a model's GSD file, which describes the virtual drive, and print its path."""
    from pnfarm.buses.profibus.description.sheet import describe_model, file_name
    from pnfarm.protocols.profibus.gsd.writer import emit_gsd

    write_description(model, directory, ".gsd", file_name, lambda one: emit_gsd(describe_model(one)))
