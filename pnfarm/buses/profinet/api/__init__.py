"""The routes of the HTTP API that only PROFINET has, and their bodies."""
