"""The routes of the HTTP API that only PROFINET has, and what they take and give."""
