"""The model through pytorch-mppi."""

from __future__ import annotations

import numpy as np

from controllers.costs import Cost
from controllers.mppi import MPPI
from controllers.rollout.threads import threads
from quadsim.app.bench.array_backend import rebind, torch_functions
from quadsim.systems import System


class TorchPeer:
    """pytorch_mppi.MPPI, as its users call it: float32, batched dynamics, all our threads."""

    def __init__(self, system: System, cost: Cost, ours: MPPI):
        import pytorch_mppi
        import torch

        torch.set_num_threads(threads())
        words = torch_functions(torch)
        step, terms, n = rebind(system.step, words), rebind(cost.terms, words), len(cost.term_names)
        self._torch = torch

        def dynamics(x, u):
            return torch.stack(step(x.unbind(1), u.unbind(1), system.params, system.dt), dim=1)

        def running_cost(x, u):
            # the cost of a state, as ours counts it: of the state that each step leads to
            return sum(terms(None, x.unbind(1), u.unbind(1), (), 0.0, cost.params)[:n])

        self._dynamics, self._cost, self._horizon = dynamics, running_cost, ours.config.horizon
        sigma = torch.diag(torch.tensor([0.3, 0.3, 0.3, 3.5]) ** 2)
        self._mppi = pytorch_mppi.MPPI(
            dynamics,
            running_cost,
            len(system.states),
            sigma,
            num_samples=ours.config.samples,
            horizon=ours.config.horizon,
            lambda_=ours.config.temperature * ours.config.horizon,  # on the summed cost
            u_min=torch.tensor(system.low, dtype=torch.float32),
            u_max=torch.tensor(system.high, dtype=torch.float32),
            u_init=torch.tensor(system.rest, dtype=torch.float32),
        )
        self._iterations = ours.config.iterations

    def control(self, x: np.ndarray) -> object:
        state = self._torch.tensor(x, dtype=self._torch.float32)
        for i in range(self._iterations):
            u = self._mppi.command(state, shift_nominal_trajectory=i == 0)
        return u

    def costs(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        torch = self._torch
        state = torch.tensor(x, dtype=torch.float32).expand(len(v), -1)
        total = torch.zeros(len(v))
        for t in range(self._horizon):
            u = torch.from_numpy(np.ascontiguousarray(v[:, t]))
            state = self._dynamics(state, u)
            total = total + self._cost(state, u)
        return (total / self._horizon).numpy()
