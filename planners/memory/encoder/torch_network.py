"""The encoder in torch, for training. ``encoder.to_onnx`` writes the same network for recall."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from planners.memory.encoder.encoder import FIRST_CELLS, LAST_CELLS, PATCH, is_pooled, layer_counts
from planners.world.geometry.occupancy import GRID

Parameters = dict[str, Tensor]


def unpacked(bits: Tensor) -> Tensor:
    """Unpack grids uint8 ``[n, 512]`` into images float32 ``[n, 1, 64, 64]``."""
    shifts = torch.arange(7, -1, -1, dtype=torch.uint8, device=bits.device)
    return ((bits[:, :, None] >> shifts) & 1).to(torch.float32).view(-1, 1, GRID, GRID)


def coarse(images: Tensor) -> Tensor:
    """Join the cells of images ``[n, 1, 64, 64]`` to ``[n, 1, 50, 50]``; those with an obstacle are 1."""
    first, last = (torch.from_numpy(each).to(images.device) for each in (FIRST_CELLS, LAST_CELLS))
    rows = torch.maximum(images[:, :, first], images[:, :, last])
    return torch.maximum(rows[..., first], rows[..., last])


def embed(parameters: Parameters, bits: Tensor) -> Tensor:
    """Embed packed grids uint8 ``[n, 512]`` as ``[n, D]``."""
    convolutions, linears = layer_counts(parameters)
    value = unpacked(bits)
    pooled = is_pooled(parameters)
    if pooled:
        value = coarse(value)
    for i in range(convolutions):
        name = f"convolution.{i}"
        weight, bias = parameters[f"{name}.weight"], parameters[f"{name}.bias"]
        stride, padding = (1, 1) if pooled or i else (PATCH, 0)
        value = functional.conv2d(value, weight, bias, stride=stride, padding=padding)
        value = functional.prelu(value, parameters[f"{name}.slope"].flatten())
        if pooled:
            value = functional.max_pool2d(value, 2)
    value = value.flatten(1)
    for i in range(linears):
        value = functional.linear(value, parameters[f"linear.{i}.weight"], parameters[f"linear.{i}.bias"])
        if i + 1 < linears:
            value = functional.prelu(value, parameters[f"linear.{i}.slope"])
    return value


@torch.no_grad()
def embed_all(parameters: Parameters, bits: Tensor, batch: int = 1024) -> Tensor:
    """Like ``embed``, in batches and without gradients."""
    last = parameters[f"linear.{layer_counts(parameters)[1] - 1}.bias"]
    embeddings = torch.empty((len(bits), len(last)), dtype=last.dtype, device=bits.device)
    for first in range(0, len(bits), batch):  # small results kept between large ones would scatter the heap
        embeddings[first : first + batch] = embed(parameters, bits[first : first + batch])
    return embeddings
