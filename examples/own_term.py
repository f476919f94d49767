"""A cost term of one's own: fast yaw costs. On the command line: race fly --term
own_term:calm_yaw=1."""

import quadsim


def calm_yaw(x, x_next, u, gate, p):
    """Return the square of the yaw rate [(rad/s)^2]; it becomes part of the compiled rollouts."""
    return x_next.wz * x_next.wz


if __name__ == "__main__":
    for terms in ([], [(calm_yaw, 1.0)]):
        run = quadsim.fly("figure8", sampler="gaussian", terms=terms, laps=1, samples=1024)
        print(
            run.outcome,
            run.laps,
            "yaw rate, root mean square:",
            run.telemetry["wz"].std().round(2),
            "rad/s",
        )
