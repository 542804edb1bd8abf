"""A problem as one attempt sees it: its structures, each made when first needed, and how long that took."""

from __future__ import annotations

from planners.world.compiling import working_clock
from planners.world.geometry.collision import Scene, scene_of
from planners.world.geometry.occupancy import Bits, Drawing, drawing_of
from planners.world.problem import Problem
from planners.world.workspace import Workspace


class View:
    """The drawing and the scene of a canonical problem.

    The drawing lies in the buffers of a workspace, so it holds until the next problem is viewed with that.
    """

    def __init__(self, problem: Problem, workspace: Workspace | None = None) -> None:
        self.problem = problem
        self.workspace = workspace or Workspace()
        self.seconds: dict[str, float] = {}  # spent so far, by part of the attempt
        self.began = self._last = working_clock()
        self._drawing: Drawing | None = None
        self._scene: Scene | None = None

    def lap(self, part: str) -> None:
        """Add the time since the last lap to ``part``."""
        now = working_clock()
        self.seconds[part] = self.seconds.get(part, 0.0) + now - self._last
        self._last = now

    @property
    def drawing(self) -> Drawing:
        """The cells that the obstacles meet."""
        if self._drawing is None:
            self._drawing = drawing_of(self.problem, self.workspace)
            self.lap("occupancy")
        return self._drawing

    @property
    def drawn(self) -> Bits | None:
        """The cells ``[64]`` that are not free, as bits, if they were drawn for something else already."""
        return None if self._drawing is None else self._drawing.occupied

    @property
    def bits(self) -> Bits:
        """The cells ``[64]`` that are not free, as bits."""
        return self.drawing.occupied

    @property
    def scene(self) -> Scene:
        """The obstacles ready for collision checks."""
        if self._scene is None:
            self._scene = scene_of(self.problem)
            self.lap("scene")
        return self._scene
