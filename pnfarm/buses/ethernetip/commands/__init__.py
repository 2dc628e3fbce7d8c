"""Commands of the program for EtherNet/IP."""
