"""Telegrams of a recorded line, as text."""
