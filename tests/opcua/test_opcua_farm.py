"""A farm in real time, in memory, as a client of OPC UA sees it."""

from __future__ import annotations

import asyncio
import contextlib

import anyio
import pytest
from farm_file import parse

ua_package = pytest.importorskip("asyncua")
