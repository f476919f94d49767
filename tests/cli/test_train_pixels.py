"""`race train-pixels`: what cannot be written or trained is one line."""

from quadsim.cli import train_pixels as command
from quadsim.cli.cli import race


def test_the_network_is_written_as_onnx(tmp_path, capsys):
    assert race(["train-pixels", "--out", str(tmp_path / "gates.npz")]) == 2
    assert "--out: expected FILE.onnx, got" in capsys.readouterr().err


def test_without_the_extra_for_training_one_line_says_what_installs_it(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(command, "find_spec", lambda name: None)
    assert race(["train-pixels", "--out", str(tmp_path / "gates.onnx")]) == 2
    assert "torch is not installed: " in capsys.readouterr().err
