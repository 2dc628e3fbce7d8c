"""One drive whatever its bus."""
