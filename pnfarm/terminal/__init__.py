"""Building blocks of commands: shared options, output, numbers, the client of a running farm's API."""
