"""A peer on a farm's PROFIBUS line, as a process of its own."""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


async def peer(script: str, *arguments: object) -> dict:
    """A program of this folder, with its arguments; the JSON of its last line."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, str(HERE / script), *map(str, arguments),
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        said, wrong = await asyncio.wait_for(process.communicate(), 60)
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    assert process.returncode == 0, wrong.decode()
    return json.loads(said.splitlines()[-1])
