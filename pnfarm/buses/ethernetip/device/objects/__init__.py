"""The drive's own CIP objects: parameters, position controller and its supervisor (AKD EtherNet/IP manual 7)."""
