"""Estimation of the state and of the vehicle from measurements, commands and the map.

It knows neither the plant nor the sensors.
"""
