"""Learn to race with PPO of stable-baselines3 (pip install stable-baselines3), then fly."""

import sys

import numpy as np
from stable_baselines3 import PPO

from quadsim.learn.stable_baselines import RacingVecEnv

# a pilot that finishes needs some 20 million
STEPS = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000

envs = RacingVecEnv(128, course="split_s_swift", start="anywhere", randomize=0.5, time_limit=10.0)
envs.seed(0)
model = PPO(
    "MlpPolicy",
    envs,
    n_steps=32,
    batch_size=2048,
    n_epochs=4,
    gamma=0.99,
    learning_rate=5e-4,
    device="cpu",
)
model.learn(STEPS)

obs = envs.reset()
gates = []
for _ in range(500):
    actions, _ = model.predict(obs, deterministic=True)
    obs, reward, done, infos = envs.step(actions)
    gates += [info["gates"] for info in infos if info]
passed = np.mean(gates) if gates else 0.0
print(f"finished {STEPS} steps: {len(gates)} flights ended, after {passed:.2f} gates in the mean")
