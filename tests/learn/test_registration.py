"""How the environments get into Gymnasium's registry, in fresh processes."""

import json
import subprocess
import sys
import textwrap

import pytest

pytest.importorskip("gymnasium", reason="the extra rl is not installed")


def printed(program):
    """Run a program in a fresh process, where a warning is an error; return the JSON it printed."""
    command = [sys.executable, "-W", "error", "-c", textwrap.dedent(program)]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr
    return json.loads(found.stdout)


@pytest.mark.process
def test_importing_the_package_or_naming_it_before_a_name_registers_the_environments():
    """Importing the project alone loads no Gymnasium."""
    program = """
        import json, sys
        import quadsim
        found = {"loaded": "gymnasium" in sys.modules}
        import gymnasium
        try:
            gymnasium.make("quadsim/Racing-v0")
        except gymnasium.error.NamespaceNotFound:
            found["alone"] = "unknown"
        for name in ("Racing-v0", "RacingBullet-v0"):
            env = gymnasium.make(f"quadsim.learn:quadsim/{name}")
            found[name] = env.observation_space.shape
        envs = gymnasium.make_vec("quadsim.learn:quadsim/Racing-v0", num_envs=3)
        found["three"] = envs.observation_space.shape
        # The package is imported by now.
        found["after"] = gymnasium.make("quadsim/Racing-v0").observation_space.shape
        print(json.dumps(found))
    """
    assert printed(program) == {
        "loaded": False,
        "alone": "unknown",
        "Racing-v0": [38],
        "RacingBullet-v0": [38],
        "three": [3, 38],
        "after": [38],
    }
