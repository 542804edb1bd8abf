"""A map as a picture: what is occupied, the blocks of each part, and where problems are cut from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.transforms import Affine2D

from dashboards.figures.pictures import draw_problem
from dashboards.figures.style import legend_below, new_figure
from dashboards.palette import BLUE, INK, OBSTACLE, ORANGE, UNKNOWN
from planners.maps.cutting import Cut
from planners.maps.occupancy_map import OccupancyMap
from planners.maps.regions import Blocks, blocks_of
from planners.maps.surroundings import WINDOW
from planners.world.arrays import Floats
from planners.world.problem import BOUNDS, CANONICAL_START
from planners.world.vehicles.vehicle import CAR, Vehicle

COLOURS: Final = {"train": BLUE, "test": ORANGE}
SHOWN_WINDOWS: Final = 4  # of each part; more hide the map


def map_picture(
    world: OccupancyMap, cuts: Mapping[str, Sequence[Cut]], scale: float, vehicle: Vehicle = CAR
) -> Figure:
    """A figure of a map in its own frame, with its blocks and cuts, beside a window of each part.

    Args:
        world: the map.
        cuts: problems cut from it, by part.
        scale: metres of the map in a metre of these problems.
        vehicle: the vehicle that stands at their starts.
    """
    parts = [part for part in cuts if cuts[part]]
    figure = new_figure(7.4 + 3.0 * bool(parts), 7.2, f"Problems cut from {world.name}")
    grid = figure.add_gridspec(
        max(len(parts), 1), 2 if parts else 1, width_ratios=[7.0, 3.0] if parts else None
    )
    axes = figure.add_subplot(grid[:, 0])
    draw_map(axes, world)
    _draw_blocks(axes, world, blocks_of(world.size, scale * WINDOW))
    for row, part in enumerate(parts):
        _draw_cuts(axes, [cut.pose for cut in cuts[part]], scale, COLOURS[part])
        beside = figure.add_subplot(grid[row, 1])
        problems = [cut.problem for cut in cuts[part][:SHOWN_WINDOWS]]
        shown = max(problems, key=lambda problem: len(problem.obstacles.piece_starts))
        draw_problem(beside, shown, vehicle)
        beside.set_title(shown.id, fontsize=9, color=COLOURS[part], pad=4)
    handles: list[Line2D | Patch] = [
        *cells_legend(world),
        *(Patch(facecolor=COLOURS[part], alpha=0.15, label=f"blocks of {part}") for part in COLOURS),
        *(
            Line2D([], [], color=COLOURS[part], label=f"{len(cuts[part]):,} starts of {part}, some windows")
            for part in parts
        ),
    ]
    legend_below(figure, handles, 3)
    return figure


def draw_map(axes: Axes, world: OccupancyMap, colour: str = OBSTACLE) -> None:
    """Draw what is occupied in ``world`` on axes in metres of the map's frame, in a ``colour``.

    Cells that are only occupied because nobody has seen them have a colour of their own.
    """
    width, height = world.size
    kinds = world.occupied.astype(np.int8)
    if world.unknown is not None:
        kinds[world.unknown] = 2
    picture = np.ma.masked_equal(kinds, 0)
    axes.imshow(
        picture,
        origin="lower",
        extent=(0.0, width, 0.0, height),
        cmap=ListedColormap([colour, UNKNOWN]),
        vmin=1,
        vmax=2,
        interpolation="nearest",
        transform=_frame(world) + axes.transData,
        zorder=1,
    )
    outline = np.array([world.pose(x, y, 0.0)[:2] for x in (0.0, width) for y in (0.0, height)])
    axes.set_xlim(outline[:, 0].min(), outline[:, 0].max())
    axes.set_ylim(outline[:, 1].min(), outline[:, 1].max())
    axes.set_aspect("equal")
    axes.tick_params(labelsize=8, colors=INK)
    axes.set_xlabel("x, m", fontsize=9)
    axes.set_ylabel("y, m", fontsize=9)


def cells_legend(world: OccupancyMap, colour: str = OBSTACLE) -> list[Line2D | Patch]:
    """What a legend says of the cells that ``draw_map`` draws."""
    has_unknown = world.unknown is not None and world.unknown.any()
    unknown = [Patch(facecolor=UNKNOWN, label="unknown, counts as occupied")] if has_unknown else []
    return [Patch(facecolor=colour, label="occupied"), *unknown]


def _frame(world: OccupancyMap) -> Affine2D:
    """The transform from grid metres to the map's frame."""
    left, bottom, turn = world.origin
    return Affine2D().rotate(turn).translate(left, bottom)


def _draw_blocks(axes: Axes, world: OccupancyMap, blocks: Blocks) -> None:
    to_axes = _frame(world) + axes.transData
    for column in range(blocks.columns):
        for row in range(blocks.rows):
            corner = np.array([column * blocks.width, row * blocks.height])
            square = corner + np.array(
                [[0, 0], [blocks.width, 0], [blocks.width, blocks.height], [0, blocks.height]]
            )
            colour = COLOURS["test" if (column + row) % 2 else "train"]
            axes.add_patch(Polygon(square, facecolor=colour, alpha=0.12, transform=to_axes, zorder=0))


def _draw_cuts(axes: Axes, poses: Sequence[tuple[float, float, float]], scale: float, colour: str) -> None:
    """Draw every start as a short line along its heading; of some also the window and the way ahead."""
    starts, headings = np.array(poses)[:, :2], np.array(poses)[:, 2]
    ahead = np.column_stack((np.cos(headings), np.sin(headings)))
    ticks = np.stack([starts, starts + 3.0 * scale * ahead], axis=1)
    axes.add_collection(LineCollection(list(ticks), colors=colour, linewidths=0.9, alpha=0.8, zorder=3))
    windows = [_window(pose, scale) for pose in poses[:SHOWN_WINDOWS]]
    axes.add_collection(PolyCollection(windows, facecolor="none", edgecolor=colour, linewidth=1.4, zorder=4))
    for x, y, heading in poses[:SHOWN_WINDOWS]:
        reach = 50.0 * math.sqrt(2.0) * scale
        tip = (x + reach * math.cos(heading), y + reach * math.sin(heading))
        axes.annotate(
            "", tip, (x, y), arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.2}, zorder=5
        )


def _window(pose: tuple[float, float, float], scale: float) -> Floats:
    x, y, heading = pose
    turn = heading - CANONICAL_START[2]
    low, high = BOUNDS[0], BOUNDS[2]
    corners = np.array([[low, low], [high, low], [high, high], [low, high]])
    cos, sin = scale * math.cos(turn), scale * math.sin(turn)
    window: Floats = corners @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    return window
