"""The other end: a PROFINET IO controller that finds, addresses, connects and runs drives, virtual or real."""
