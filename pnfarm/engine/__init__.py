"""The cyclic engine: everything that happens every cycle, compiled, in a thread of its own or in virtual time."""
