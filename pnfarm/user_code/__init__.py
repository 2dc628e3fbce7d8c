"""Python code of users, which runs in this process: read from files, called with a limit."""
