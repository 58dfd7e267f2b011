"""Gridwright's Python client and command line."""

from gridwright_client.client import MappingClient
from gridwright_client.errors import GridwrightRpcError
from gridwright_client.results import OccupancyMap, Trajectory

__all__ = ["GridwrightRpcError", "MappingClient", "OccupancyMap", "Trajectory"]
