"""Where and how training runs: deterministically, and on a GPU compiled and in mixed precision."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch
from torch import Tensor

from planners.memory.encoder.torch_network import embed

Embedder = Callable[[dict[str, Tensor], Tensor], Tensor]


@contextmanager
def deterministic(threads: int) -> Iterator[torch.device]:
    """Make torch deterministic, with so many threads, and give the device to train on; undo it at the end."""
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # without it cuBLAS is not deterministic
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    before, was_deterministic = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    torch.set_num_threads(threads)
    _be_deterministic(True, device)
    try:
        yield device
    finally:
        torch.set_num_threads(before)
        _be_deterministic(was_deterministic, device)


def _be_deterministic(on: bool, device: torch.device) -> None:
    if (
        device.type == "cpu"
    ):  # the same for what is not compiled, without a second of imports for the compiler
        torch.set_deterministic_debug_mode("error" if on else "default")
    else:
        torch.use_deterministic_algorithms(on)


def forward_on(device: torch.device) -> Embedder:
    """Return the encoder (``torch_network.embed``) as training runs it on a device."""
    if device.type == "cpu":
        return embed
    compiled = torch.compile(embed)

    def mixed(parameters: dict[str, Tensor], bits: Tensor) -> Tensor:
        with torch.autocast(device.type, torch.bfloat16):
            return compiled(parameters, bits).float()

    return mixed
