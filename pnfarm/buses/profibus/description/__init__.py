"""The file that describes a virtual drive to engineering tools."""
