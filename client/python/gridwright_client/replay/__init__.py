"""Replaying a recorded log through a mapping server."""
