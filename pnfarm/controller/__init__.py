"""The built-in controller of a bus in real time and in virtual time, with virtual or real drives."""
