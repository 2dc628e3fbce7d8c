"""CIP: what a drive of it has beside its parameters, whatever network carries it."""
