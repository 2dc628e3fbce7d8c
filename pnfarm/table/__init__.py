"""The farm as a table: structured NumPy arrays that the engine shares with all other parts."""
