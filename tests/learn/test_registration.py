"""How the environments get into Gymnasium's registry, each in a process of its own."""

import subprocess
import sys
import textwrap

import pytest

pytest.importorskip("gymnasium", reason="the extra rl is not installed")


def python(program):
    """Run a program in a fresh process; return what it printed."""
    command = [sys.executable, "-W", "error", "-c", textwrap.dedent(program)]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr
    return found.stdout.strip()


@pytest.mark.parametrize("name", ["Racing-v0", "RacingBullet-v0"])
def test_the_package_before_a_name_makes_an_environment_without_an_import(name):
    program = f"""
        import gymnasium
        env = gymnasium.make("quadsim.learn:quadsim/{name}")
        print(env.observation_space.shape)
    """
    assert python(program) == "(38,)"


def test_the_package_before_a_name_makes_many_environments():
    program = """
        import gymnasium
        envs = gymnasium.make_vec("quadsim.learn:quadsim/Racing-v0", num_envs=3)
        print(envs.observation_space.shape)
    """
    assert python(program) == "(3, 38)"


@pytest.mark.parametrize(
    "imports", ["import gymnasium, quadsim.learn", "import quadsim.learn, gymnasium"]
)
def test_importing_the_package_registers_the_environments(imports):
    program = f"""
        {imports}
        print(gymnasium.make("quadsim/Racing-v0").observation_space.shape)
    """
    assert python(program) == "(38,)"


@pytest.mark.parametrize("first", ["import quadsim", "pass"])
def test_nothing_else_registers_them(first):
    program = f"""
        {first}
        import gymnasium
        try:
            gymnasium.make("quadsim/Racing-v0")
        except gymnasium.error.NamespaceNotFound:
            print("unknown")
    """
    assert python(program) == "unknown"


def test_importing_the_project_loads_no_gymnasium():
    assert python("import sys, quadsim; print('gymnasium' in sys.modules)") == "False"
