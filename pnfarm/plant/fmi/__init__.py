"""Models of the plant that are FMUs for co-simulation (FMI 2.0 and 3.0), each in a process of its own."""
