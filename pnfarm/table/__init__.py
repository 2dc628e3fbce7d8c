"""The farm as a table: structured NumPy arrays that the engine and everybody else share."""
