"""The state of a whole farm as plain JSON: taken, checked, put back, and kept in files."""
