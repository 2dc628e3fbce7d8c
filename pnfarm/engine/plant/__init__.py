"""The plant's steps in the engine's ticks."""
