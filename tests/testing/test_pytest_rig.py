"""The fixture ``pnfarm_rig`` in real time: a farm file, and a farm that runs already."""
