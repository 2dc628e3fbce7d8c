"""The cyclic engine: everything that happens every cycle, compiled, in its own thread or in virtual time."""
