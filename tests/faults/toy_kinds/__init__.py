"""Kinds of injections that only tests have."""
