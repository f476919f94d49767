"""What is flown: actuators, rigid bodies, plants, domain randomization."""
