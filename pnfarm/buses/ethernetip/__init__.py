"""EtherNet/IP: the AKD on CIP."""
