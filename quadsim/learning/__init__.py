"""Learning to fly: Proximal Policy Optimization on the compiled environments, evaluation, checkpoints."""
