"""Faults of the machine against a running service."""
