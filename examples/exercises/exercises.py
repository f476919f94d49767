"""Three exercises: complete the functions. docs/exercises.md explains each of them.

race fly figure8 --laps 1 --controller exercises:First
python grade.py 1
"""

from racer import Racer


class First(Racer):
    """Exercise 1: make MPPI fly."""

    def noise(self, rng, shape):
        """Return standard normal perturbations of this shape: (samples, steps, controls)."""
        raise NotImplementedError("exercise 1: return white noise")

    def weights(self, costs, temperature):
        """Return the weights (samples,) of costs (samples,), as in Algorithm 1 of the paper."""
        raise NotImplementedError("exercise 1: return a softmax of -costs / temperature")


class Second(First):
    """Exercise 2: fly faster and smoother by noise of low frequencies."""

    def noise(self, rng, shape):
        """Return perturbations of standard deviation 1 whose power falls with the frequency."""
        raise NotImplementedError("exercise 2: return colored noise")


class Third(Second):
    """Exercise 3: find the temperature by measurement."""

    def temperature(self, costs):
        """Return the temperature [m]."""
        raise NotImplementedError("exercise 3: return the temperature that you have found")
