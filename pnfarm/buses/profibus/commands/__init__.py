"""Commands that PROFIBUS adds to the program."""
