"""The multilevel Rao-Blackwellized particle filter: pure numpy and numba."""
