"""What routes of the HTTP API are made of, those of a bus as well: bodies, answers, errors, types."""
