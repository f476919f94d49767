"""Estimation of the state and of the vehicle from measurements, commands and the map, without plant
and sensors."""
