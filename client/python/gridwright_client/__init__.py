"""Gridwright's Python client and command line."""
