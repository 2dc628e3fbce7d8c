"""A bus over streams and datagrams: its drive sends back what comes, in capitals."""
