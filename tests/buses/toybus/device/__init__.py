"""The drive's end of the toy bus."""
