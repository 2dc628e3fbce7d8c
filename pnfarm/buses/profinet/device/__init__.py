"""A PROFINET device: the protocol machines of one drive, joined."""
