"""Building blocks of the HTTP API's routes, also of a bus's: bodies, responses, errors, types."""
