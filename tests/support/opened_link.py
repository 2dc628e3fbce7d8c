"""A link of some interfaces, for as long as a test looks at it."""

import contextlib


@contextlib.asynccontextmanager
async def opened(link, wanted):
    ports = await link.open(wanted)
    try:
        yield ports
    finally:
        await link.close()
