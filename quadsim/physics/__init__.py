"""The simulated vehicle: actuators, rigid bodies, plants, domain randomization."""
