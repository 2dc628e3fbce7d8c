"""The words of a user, read and said in one way wherever they stand: farm file, command line, API."""
