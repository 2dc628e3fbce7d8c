"""GSD files: the text, what it describes, a slave as it is plugged, and a writer."""
