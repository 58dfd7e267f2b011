"""Scan matching: the exact two-level search and its refinement below a cell."""
