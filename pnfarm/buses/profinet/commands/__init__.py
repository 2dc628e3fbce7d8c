"""The commands that only PROFINET has, one file each, imports inside the commands."""
