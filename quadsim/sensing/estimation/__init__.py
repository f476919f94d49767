"""The estimator: a state of measurements, commands and the map. It knows neither sensors nor plant nor truth."""
