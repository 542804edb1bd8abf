"""The encoder, from occupancy grid to embedding, and its runtime, which needs no torch.

It has convolutions with PReLU, then fully connected layers, and no normalisation. There are two networks.
``pooled`` is the paper's (IV-A): it sees 50x50 cells, and a max-pool of 2x2 follows each convolution of 3x3.
``patches`` has no pooling. Its first convolution takes patches of 4x4 cells with stride 4: whether a plan is
free depends on where exactly an obstacle lies, and pooling loses that. On fresh problems of class random
the first plan was free in 67 % of what 100 plans can solve, with pooling in 51 % (one seed; 25 and 21 s of
training).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from planners.world.arrays import Floats32
from planners.world.geometry.occupancy import GRID, Grid

Weights = dict[str, Floats32]  # "convolution.0.weight", ".bias", ".slope", ..., "linear.0.weight", ...

NETWORKS: Final = ("patches", "pooled")
PATCH = 4  # cells a side, and stride, of the first convolution of ``patches``; all others are 3x3
POOLED_GRID: Final = 50  # cells a side that ``pooled`` sees
_COARSE = (np.arange(GRID) + 0.5) * POOLED_GRID // GRID  # the one of these in which each cell's centre lies
FIRST_CELLS: Final = np.searchsorted(_COARSE, np.arange(POOLED_GRID))  # [POOLED_GRID] a cell within each
LAST_CELLS: Final = np.searchsorted(_COARSE, np.arange(POOLED_GRID), "right") - 1  # the same one, or the next
PRELU_SLOPE = 0.25  # initial (He et al. 2015)
OPSET = 17
LARGEST_VALUE = 1e20  # in the network; float32 ends at 3e38, bounds of trained ones are some 1e5
IR_VERSION = 9  # the oldest that has the opset, so that old runtimes can read it


@dataclass(frozen=True)
class Architecture:
    """Sizes of the encoder."""

    channels: tuple[int, ...] = (16,)  # of the convolutions
    hidden: tuple[int, ...] = (128,)  # widths of the fully connected layers before the embedding
    dimensions: int = 30  # of the embedding
    network: str = NETWORKS[0]

    def __post_init__(self) -> None:
        if self.network not in NETWORKS:
            raise ValueError(f"Unknown network {self.network!r}; choose one of {', '.join(NETWORKS)}.")
        if self.network == "pooled" and not POOLED_GRID >> len(self.channels):
            raise ValueError(f"{len(self.channels)} convolutions pool {POOLED_GRID} cells away: give fewer.")
        if not self.channels:
            raise ValueError("The encoder has no convolution: give the channels of one or more.")
        if min((*self.channels, *self.hidden, self.dimensions)) < 1:
            sizes = f"{self.channels}, {self.hidden}, {self.dimensions}"
            raise ValueError(f"Sizes of the encoder are {sizes}: give 1 or more.")


def described_architecture(described: Any) -> Architecture:
    """Return the architecture that JSON values describe; without a ``network`` it is of ``patches``.

    Raises ValueError if there is no such architecture.
    """
    try:
        sizes = {name: tuple(described[name]) for name in ("channels", "hidden")}
        return Architecture(**{**described, **sizes})
    except (KeyError, TypeError):
        raise ValueError("its architecture is not one of an encoder") from None


def weight_shapes(architecture: Architecture) -> dict[str, tuple[int, ...]]:
    """Return the names and shapes of the weights, layer by layer."""
    shapes: dict[str, tuple[int, ...]] = {}
    inputs = 1
    pooled = architecture.network == "pooled"
    for i, outputs in enumerate(architecture.channels):
        kernel = 3 if pooled or i else PATCH
        shapes[f"convolution.{i}.weight"] = (outputs, inputs, kernel, kernel)
        shapes[f"convolution.{i}.bias"] = (outputs,)
        shapes[f"convolution.{i}.slope"] = (outputs, 1, 1)
        inputs = outputs
    width = inputs * (POOLED_GRID >> len(architecture.channels) if pooled else GRID // PATCH) ** 2
    for i, outputs in enumerate((*architecture.hidden, architecture.dimensions)):
        shapes[f"linear.{i}.weight"] = (outputs, width)
        shapes[f"linear.{i}.bias"] = (outputs,)
        if i < len(architecture.hidden):
            shapes[f"linear.{i}.slope"] = (outputs,)
        width = outputs
    return shapes


def initial_weights(architecture: Architecture, rng: np.random.Generator) -> Weights:
    """Draw weights to begin training with: normal, scaled for PReLU (He et al. 2015). Biases are zero."""
    last = f"linear.{len(architecture.hidden)}.weight"
    weights: Weights = {}
    for name, shape in weight_shapes(architecture).items():
        if name.endswith(".weight"):
            gain = 1.0 if name == last else 2.0 / (1.0 + PRELU_SLOPE**2)
            fan_in = float(np.prod(shape[1:]))
            weights[name] = rng.normal(0.0, np.sqrt(gain / fan_in), shape).astype(np.float32)
        else:
            weights[name] = np.full(shape, 0.0 if name.endswith(".bias") else PRELU_SLOPE, np.float32)
    return weights


def architecture_of(weights: Mapping[str, Floats32]) -> Architecture:
    """Return the sizes of the network with these weights.

    Raises ValueError if they are not the weights of an encoder.
    """
    try:
        convolutions, linears = layer_counts(weights)
        widths = [len(weights[f"linear.{i}.bias"]) for i in range(linears)]
        architecture = Architecture(
            tuple(len(weights[f"convolution.{i}.bias"]) for i in range(convolutions)),
            tuple(widths[:-1]),
            widths[-1],
            NETWORKS[is_pooled(weights)],
        )
    except (KeyError, IndexError, TypeError, ValueError):
        raise ValueError("these are not the weights of an encoder: a layer is missing") from None
    if {name: tensor.shape for name, tensor in weights.items()} != weight_shapes(architecture):
        raise ValueError("these are not the weights of an encoder: the layers do not fit together")
    return architecture


def is_pooled(weights: Mapping[str, Any]) -> bool:
    """Return whether these are the weights of the network ``pooled``, by its first convolution."""
    return bool(weights["convolution.0.weight"].shape[-1] != PATCH)


def layer_counts(weights: Mapping[str, object]) -> tuple[int, int]:
    """Count the convolutions and the fully connected layers of a network."""
    names = {name.rsplit(".", 1)[0] for name in weights}
    convolutions, linears = (
        sum(name.startswith(kind) for name in names) for kind in ("convolution.", "linear.")
    )
    return convolutions, linears


def magnitude(numbers: Floats32) -> float:
    """Return the largest absolute value, infinity and NaN included, of an array of any shape."""
    return max(float(numbers.max()), -float(numbers.min()))


def embedding_bound(weights: Weights) -> float:
    """Bound the entries of an embedding, whatever the grid, by the largest weights of each layer.

    Raises ValueError if the weights are not finite, or so large that a value in the network could exceed
    ``LARGEST_VALUE``.
    """
    convolutions, linears = layer_counts(weights)
    layers = [f"convolution.{i}" for i in range(convolutions)] + [f"linear.{i}" for i in range(linears)]
    bound = 1.0  # of a cell
    for name in layers:
        inputs = weights[f"{name}.weight"][0].size
        bound = bound * inputs * magnitude(weights[f"{name}.weight"]) + magnitude(weights[f"{name}.bias"])
        if f"{name}.slope" in weights:
            bound *= max(1.0, magnitude(weights[f"{name}.slope"]))
        if not bound <= LARGEST_VALUE:
            raise ValueError(f"the weights of {name} are so large that the encoder could overflow")
    return bound


def to_onnx(weights: Weights) -> bytes:
    """Serialise the network as an ONNX model: ``grid`` uint8 [n, 64, 64] to ``embedding`` float32 [n, D]."""
    from onnx import TensorProto, helper, numpy_helper

    convolutions, linears = layer_counts(weights)
    nodes = [
        helper.make_node("Cast", ["grid"], ["cells"], to=TensorProto.FLOAT),
        helper.make_node("Reshape", ["cells", "image_shape"], ["image"]),
    ]
    value = "image"

    def chain(operation: str, *inputs: str, **attributes: Any) -> None:
        nonlocal value
        output = f"value{len(nodes)}"
        nodes.append(helper.make_node(operation, [value, *inputs], [output], **attributes))
        value = output

    pooled = is_pooled(weights)
    joined = {"first_cells": FIRST_CELLS, "last_cells": LAST_CELLS} if pooled else {}
    for axis in (2, 3) if pooled else ():
        outputs = [f"{cells}_{axis}" for cells in joined]
        for cells, output in zip(joined, outputs, strict=True):
            nodes.append(helper.make_node("Gather", [value, cells], [output], axis=axis))
        value = f"coarse_{axis}"
        nodes.append(helper.make_node("Max", outputs, [value]))
    for i in range(convolutions):
        name = f"convolution.{i}"
        stride, padding = (1, 1) if pooled or i else (PATCH, 0)
        chain("Conv", f"{name}.weight", f"{name}.bias", strides=[stride] * 2, pads=[padding] * 4)
        chain("PRelu", f"{name}.slope")
        if pooled:
            chain("MaxPool", kernel_shape=[2, 2], strides=[2, 2])
    chain("Flatten")
    for i in range(linears):
        chain("Gemm", f"linear.{i}.weight", f"linear.{i}.bias", transB=1)
        if i + 1 < linears:
            chain("PRelu", f"linear.{i}.slope")
    nodes[-1].output[0] = "embedding"
    dimensions = len(weights[f"linear.{linears - 1}.bias"])
    graph = helper.make_graph(
        nodes,
        "encoder",
        [helper.make_tensor_value_info("grid", TensorProto.UINT8, ["n", GRID, GRID])],
        [helper.make_tensor_value_info("embedding", TensorProto.FLOAT, ["n", dimensions])],
        [
            numpy_helper.from_array(np.array([-1, 1, GRID, GRID], np.int64), "image_shape"),
            *(numpy_helper.from_array(cells, name) for name, cells in joined.items()),
            *(numpy_helper.from_array(np.asarray(weights[name]), name) for name in sorted(weights)),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    serialised: bytes = model.SerializeToString()
    return serialised


@dataclass(frozen=True)
class Encoder:
    """Runs a serialised ONNX encoder on one thread. Only the model's bytes are pickled."""

    model: bytes

    @functools.cached_property
    def _run(self) -> Callable[..., list[Floats32]]:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
        session = onnxruntime.InferenceSession(self.model, options, providers=["CPUExecutionProvider"])
        run: Callable[..., list[Floats32]] = session.run
        return run

    def __getstate__(self) -> dict[str, bytes]:
        return {"model": self.model}

    def __call__(self, grids: Grid) -> Floats32:
        """Embed one grid ``[64, 64]`` as ``[D]``, or grids ``[n, 64, 64]`` as ``[n, D]``; cells are 0 or 1.

        Raises ValueError for grids of another type or shape.
        """
        if grids.dtype != np.uint8 or grids.ndim not in (2, 3) or grids.shape[-2:] != (GRID, GRID):
            raise ValueError(
                f"grid is {grids.dtype} {list(grids.shape)}, the encoder needs uint8 [{GRID}, {GRID}] "
                f"or [n, {GRID}, {GRID}]. Was it drawn by planners.world.geometry.occupancy?"
            )
        embeddings = self._run(None, {"grid": grids.reshape(-1, GRID, GRID)})[0]
        return embeddings.reshape(*grids.shape[:-2], -1)
