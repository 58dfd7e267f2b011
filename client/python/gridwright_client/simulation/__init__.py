"""A robot with drifting odometry and a noisy laser in a building, for demonstrations and tests."""

from gridwright_client.simulation.files import SimulationFiles, write_simulation
from gridwright_client.simulation.run import Simulation, SimulationOptions, run_simulation

__all__ = ["Simulation", "SimulationFiles", "SimulationOptions", "run_simulation", "write_simulation"]
