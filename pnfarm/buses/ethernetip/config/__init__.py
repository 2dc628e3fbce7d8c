"""EtherNet/IP's part of the farm file."""
