"""The other end: the bus's controller in real time and in virtual time, against drives virtual or real."""
