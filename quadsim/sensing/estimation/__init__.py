"""Estimation of the state and of the vehicle from measurements, commands and the map.

The package imports neither the plant nor the sensors nor what finds gates in pictures.
"""
