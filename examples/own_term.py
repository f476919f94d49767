"""Add a cost term of your own: fast yaw costs.

On the command line: race fly --term own_term:calm_yaw=1
"""

import quadsim


def calm_yaw(x, x_next, u, gate, p):
    """Return the square of the yaw rate [(rad/s)^2]; it becomes part of the compiled rollouts."""
    return x_next.wz * x_next.wz


if __name__ == "__main__":
    for terms in ([], [(calm_yaw, 1.0)]):
        settings = {"sampler": "gaussian", "sigma": (0.9, 0.9, 4.0, 3.8), "laps": 1}
        run = quadsim.fly("figure8", terms=terms, **settings)
        yaw_rate = run.telemetry["wz"].std()
        print(run.outcome, run.laps, f"yaw rate, root mean square: {yaw_rate:.2f} rad/s")
