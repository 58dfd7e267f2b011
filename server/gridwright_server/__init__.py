"""Gridwright's mapping server."""
