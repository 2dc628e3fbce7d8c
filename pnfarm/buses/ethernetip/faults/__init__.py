"""Faults of drives on EtherNet/IP."""
