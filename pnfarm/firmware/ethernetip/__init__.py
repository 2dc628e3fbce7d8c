"""The position controller's assemblies in front of an axis (AKD EtherNet/IP manual 6.2)."""
