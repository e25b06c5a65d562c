"""Damaged series of every codec, and what comes of them."""
