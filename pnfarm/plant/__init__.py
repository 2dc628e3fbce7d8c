"""The plant: what lies behind the stations, joined with their signals by wires."""
