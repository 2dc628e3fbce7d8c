"""PROFIdrive over records: base mode parameter access and the fault buffer."""
