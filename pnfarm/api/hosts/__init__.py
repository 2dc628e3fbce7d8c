"""A farm's answers to the paths of each subject."""
