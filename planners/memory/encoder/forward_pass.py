"""The encoder's forward pass for the bits of one grid, several times faster than a general runtime.

It handles one shape of network: a single convolution, whose patches do not overlap, then fully connected
layers. Empty patches all contribute the same, and so do full ones, so these contributions are summed up
beforehand, and only patches in which an obstacle begins or ends are multiplied. Most of the time goes into
reading the weights, so they lie in the order of reading, as 16-bit numbers. ONNX Runtime runs other networks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from planners.memory.encoder.encoder import PATCH, Encoder, Weights, is_pooled, layer_counts, to_onnx
from planners.world.arrays import Floats32, Integers
from planners.world.geometry.occupancy import GRID, Bits, grid_of
from planners.world.jit import lean

Shorts = np.ndarray[tuple[int, ...], np.dtype[np.int16]]
Forward = Callable[[Bits], Floats32]  # bits [64] of a grid to its embedding [D]

SIDE = GRID // PATCH  # patches a side
_TOGETHER = 8  # channels that are added at once, for fewer passes over the hidden units
_PATCH_BITS = np.uint64((1 << PATCH) - 1)


class Tables(NamedTuple):
    """The weights laid out for ``_embed``, for C channels, padded to a multiple of 8, and H hidden units."""

    rows: Floats32  # [PATCH, 2^PATCH, C] contribution of the four cells in a row of a patch
    bias: Floats32  # [C] of the convolution
    slope: Floats32  # [C] of its PReLU
    empty: Floats32  # [C] activations of a patch without an obstacle
    weights: Shorts  # [SIDE^2, C, H] of the first fully connected layer, in units of ...
    scale: Floats32  # [H] of each hidden unit
    base: Floats32  # [H] its sums if every patch is empty
    full: Floats32  # [SIDE^2, H] what a full patch adds to these
    later: Floats32  # the later layers, end to end: of each the slopes before, weights [in, out], biases
    widths: Integers  # [L + 1] H, and the widths of the later layers


@lean
def _embed(bits: Bits, tables: Tables, values: Floats32, embedding: Floats32) -> None:
    """Fill in ``embedding [D]``; ``values [3, widest layer]`` is scratch."""
    channels = tables.bias.shape[0]
    hidden = tables.widths[0]
    sums = values[0]
    activations = values[1]
    scaled = values[2]
    for h in range(hidden):
        sums[h] = tables.base[h]
        scaled[h] = np.float32(0.0)
    for patch in range(SIDE * SIDE):
        row = patch // SIDE * PATCH
        shift = np.uint64(patch % SIDE * PATCH)
        cells_0 = (bits[row] >> shift) & _PATCH_BITS
        cells_1 = (bits[row + 1] >> shift) & _PATCH_BITS
        cells_2 = (bits[row + 2] >> shift) & _PATCH_BITS
        cells_3 = (bits[row + 3] >> shift) & _PATCH_BITS
        if cells_0 | cells_1 | cells_2 | cells_3 == np.uint64(0):
            continue
        if cells_0 & cells_1 & cells_2 & cells_3 == _PATCH_BITS:
            for h in range(hidden):
                sums[h] += tables.full[patch, h]
            continue
        for c in range(channels):
            value = (
                tables.bias[c]
                + tables.rows[0, cells_0, c]
                + tables.rows[1, cells_1, c]
                + tables.rows[2, cells_2, c]
                + tables.rows[3, cells_3, c]
            )
            activations[c] = max(value, np.float32(0.0)) + tables.slope[c] * min(value, np.float32(0.0))
            activations[c] -= tables.empty[c]
        for c in range(0, channels, _TOGETHER):
            a_0 = activations[c]
            a_1 = activations[c + 1]
            a_2 = activations[c + 2]
            a_3 = activations[c + 3]
            a_4 = activations[c + 4]
            a_5 = activations[c + 5]
            a_6 = activations[c + 6]
            a_7 = activations[c + 7]
            weights = tables.weights[patch]
            for h in range(hidden):
                scaled[h] += (
                    (a_0 * np.float32(weights[c, h]) + a_1 * np.float32(weights[c + 1, h]))
                    + (a_2 * np.float32(weights[c + 2, h]) + a_3 * np.float32(weights[c + 3, h]))
                ) + (
                    (a_4 * np.float32(weights[c + 4, h]) + a_5 * np.float32(weights[c + 5, h]))
                    + (a_6 * np.float32(weights[c + 6, h]) + a_7 * np.float32(weights[c + 7, h]))
                )
    for h in range(hidden):
        sums[h] += tables.scale[h] * scaled[h]
    at = 0
    source = 0
    for layer in range(1, tables.widths.shape[0]):
        inputs = tables.widths[layer - 1]
        outputs = tables.widths[layer]
        before = values[source]
        after = values[1 - source]
        for i in range(inputs):
            slope = tables.later[at + i]
            before[i] = max(before[i], np.float32(0.0)) + slope * min(before[i], np.float32(0.0))
        at += inputs
        biases = at + inputs * outputs
        for o in range(outputs):
            after[o] = tables.later[biases + o]
        for i in range(inputs):
            value = before[i]
            for o in range(outputs):
                after[o] += value * tables.later[at + i * outputs + o]
        at = biases + outputs
        source = 1 - source
    for o in range(embedding.shape[0]):
        embedding[o] = values[source, o]


def _prelu(values: Floats32, slope: Floats32) -> Floats32:
    return np.maximum(values, 0.0) + slope * np.minimum(values, 0.0)


def tables_of(weights: Weights) -> Tables:
    """Lay out the weights of a network with one convolution."""
    linears = layer_counts(weights)[1]
    channels = len(weights["convolution.0.bias"])
    padding = [(0, -channels % _TOGETHER)]
    kernel = np.pad(
        weights["convolution.0.weight"].reshape(channels, PATCH, PATCH), [*padding, (0, 0), (0, 0)]
    )
    bias = np.pad(weights["convolution.0.bias"], padding)
    slope = np.pad(weights["convolution.0.slope"].reshape(-1), padding)
    patterns = (np.arange(1 << PATCH)[:, None] >> np.arange(PATCH)) & 1  # [2^PATCH, PATCH]
    rows = np.einsum("bx,cyx->ybc", patterns, kernel)
    empty, full = _prelu(bias, slope), _prelu(bias + kernel.sum((1, 2)), slope)
    first = weights["linear.0.weight"]  # [H, channels * SIDE^2]
    by_patch = first.reshape(len(first), channels, SIDE * SIDE).transpose(2, 1, 0)
    by_patch = np.pad(by_patch, [(0, 0), *padding, (0, 0)])
    scale = np.maximum(np.abs(by_patch).max((0, 1)), 1e-30) / np.iinfo(np.int16).max
    sums = np.einsum("pch,c->h", by_patch, empty, dtype=np.float64) + weights["linear.0.bias"]
    later = []
    widths = [len(first)]
    for i in range(1, linears):
        layer = weights[f"linear.{i}.weight"]
        later += [weights[f"linear.{i - 1}.slope"], layer.T.ravel(), weights[f"linear.{i}.bias"]]
        widths.append(len(layer))

    def packed(values: Floats32) -> Floats32:
        return np.ascontiguousarray(values, np.float32)

    return Tables(
        packed(rows),
        packed(bias),
        packed(slope),
        packed(empty),
        np.ascontiguousarray(np.rint(by_patch / scale), np.int16),
        packed(scale),
        packed(sums),
        packed(np.einsum("pch,c->ph", by_patch, full - empty)),
        packed(np.concatenate([np.empty(0), *later])),
        np.array(widths, np.int32),
    )


def forward_of(weights: Weights) -> Forward:
    """Return a function that embeds the bits ``[64]`` of one grid in a new array ``[D]``."""
    if is_pooled(weights) or layer_counts(weights)[0] > 1:
        encoder = Encoder(to_onnx(weights))
        return lambda bits: encoder(grid_of(bits))
    tables = tables_of(weights)
    widest = max(*tables.widths.tolist(), len(tables.bias))

    def embed(bits: Bits) -> Floats32:
        embedding = np.empty(tables.widths[-1], np.float32)
        _embed(bits, tables, np.empty((3, widest), np.float32), embedding)
        return embedding

    return embed
