"""Maps: tiles shared copy-on-write, occupancy, the likelihood field and its coarse level."""
