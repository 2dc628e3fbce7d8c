"""Scenarios: a timeline of faults and expectations, run against a farm, and the verdict.  Names no fieldbus."""
