"""``trainer.precision=auto`` on machines with and without fast bfloat16."""

import logging

import pytest
import torch

from stereo_occ.cli import compose_config
from stereo_occ.precision import PRECISIONS, chosen_precision


@pytest.mark.parametrize(
    ("capability", "precision"),
    [
        ("AVX512", "bf16-mixed"),
        ("AVX2", "32-true"),
        ("DEFAULT", "32-true"),
    ],
)
def test_auto_takes_what_the_processor_is_fast_in(
    monkeypatch: pytest.MonkeyPatch, capability: str, precision: str
) -> None:
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: capability)

    assert chosen_precision("auto", "cpu") == precision


@pytest.mark.parametrize(("native", "precision"), [(True, "bf16-mixed"), (False, "16-mixed")])
def test_auto_takes_what_the_gpu_is_fast_in(
    monkeypatch: pytest.MonkeyPatch, native: bool, precision: str
) -> None:
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda including_emulation: native)

    assert chosen_precision("auto", "gpu") == precision


def test_emulated_bfloat16_is_warned_of_and_kept(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: "AVX2")

    assert chosen_precision("bf16-mixed", "cpu") == "bf16-mixed"
    assert "only emulated here" in caplog.text


@pytest.mark.parametrize("precision", [name for name in PRECISIONS if name != "auto"])
def test_what_is_asked_and_fast_is_taken_without_a_word(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, precision: str
) -> None:
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: "AVX512")
    caplog.set_level(logging.INFO)

    assert chosen_precision(precision, "cpu") == precision
    assert not caplog.text


def test_the_recipe_is_fast_on_any_machine() -> None:
    assert compose_config("train", ["experiment=recipe"]).trainer.precision == "auto"
