"""Puts EtherNet/IP's frames of a capture into words."""
