"""Built-in behaviours of the plant, one file each, and the couplings of shafts: what runs in the engine's ticks."""
