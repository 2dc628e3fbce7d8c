"""``pnfarm gsdml``: the file that an engineering tool imports for a virtual drive."""

from __future__ import annotations

from pathlib import Path

from pnfarm.terminal.description_file import FolderOption, ModelArgument, write_description

__all__ = ["gsdml"]


def gsdml(model: ModelArgument, directory: FolderOption = Path()) -> None:
    """Write a model's GSDML file, which describes the virtual drive, and print its path."""
    from pnfarm.buses.profinet.model_gsdml import describe_model, file_name
    from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

    write_description(model, directory, ".xml", file_name, lambda one: emit_gsdml(describe_model(one)).encode())
