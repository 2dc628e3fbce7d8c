"""The farm file: read, checked as a whole, expanded to drives; its JSON Schema."""
