"""The standard's objects of a target, each over plain data: one file, one class."""
