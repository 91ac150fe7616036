"""In which numbers to train: ``auto`` is whatever this machine multiplies fast."""

import logging

import torch

#: Known to Lightning, and ``auto``.
PRECISIONS = ("auto", "32-true", "bf16-mixed", "16-mixed")

logger = logging.getLogger(__name__)


def on_gpu(accelerator: str) -> bool:
    """Whether ``trainer.accelerator`` is a GPU here."""
    return accelerator == "gpu" or (accelerator == "auto" and torch.cuda.is_available())


def has_bfloat16(accelerator: str) -> bool:
    """Whether bfloat16 is a gain: oneDNN emulates it on processors without AVX-512, many times slower than float32.

    https://uxlfoundation.github.io/oneDNN/dev_guide_data_types.html
    """
    if on_gpu(accelerator):
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    return torch.backends.cpu.get_cpu_capability().startswith("AVX512")


def chosen_precision(precision: str, accelerator: str) -> str:
    """What Lightning is told for ``trainer.precision``; a line in the log if that is not what was asked, or slow.

    Returns:
        for ``auto``: bfloat16 where it is fast, else half precision on a GPU and float32 on a processor.
    """
    fast = has_bfloat16(accelerator)
    if precision == "auto":
        chosen = "bf16-mixed" if fast else "16-mixed" if on_gpu(accelerator) else "32-true"
        logger.info("trainer.precision=auto: %s is fast here", chosen)
        return chosen
    if precision == "bf16-mixed" and not fast:
        logger.warning(
            "trainer.precision=bf16-mixed: only emulated here, a step takes many times as long; auto takes what is fast"
        )
    return precision
