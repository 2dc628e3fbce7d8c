"""Telegrams and the data in them."""
