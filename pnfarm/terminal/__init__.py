"""What commands are made of: shared options, output, numbers, the client of a running farm's API."""
