"""What users write, read and printed alike everywhere: farm file, command line, API."""
