"""``pnfarm eds``: the file that an engineering tool imports for a virtual drive on EtherNet/IP."""

from __future__ import annotations

from pathlib import Path

from pnfarm.terminal.description_file import FolderOption, ModelArgument, write_description

__all__ = ["eds"]


def eds(model: ModelArgument, directory: FolderOption = Path()) -> None:
    """Write a model's EDS file, which describes the virtual drive, and print its path."""
    from pnfarm.buses.ethernetip.description.sheet import comments, describe_model, file_name
    from pnfarm.protocols.enip.eds.text import emit_eds

    write_description(model, directory, ".eds", file_name, lambda one: emit_eds(describe_model(one), comments(one)))
