"""The drive's end of EtherNet/IP."""
