"""Kernels by vehicle as compiled functions: called from Python they would be interpreted."""

from __future__ import annotations

from planners.world.geometry import collision
from planners.world.jit import jit
from planners.world.vehicles import dynamics


@jit
def step(state, first, second, vehicle):
    return dynamics.step(state, first, second, vehicle)


@jit
def admissible(state, first, second, vehicle):
    return dynamics.admissible(state, first, second, vehicle)


@jit
def swept_bodies(state, vehicle):
    return dynamics.swept_bodies(state, vehicle)


@jit
def state_is_free(state, vehicle, scene):
    return collision.state_is_free(state, vehicle, scene)


@jit
def is_folded(state, vehicle):
    return dynamics.is_folded(state, vehicle)


@jit
def lateral_acceleration(state, vehicle):
    return dynamics.lateral_acceleration(state, vehicle)


@jit
def slides(state, vehicle):
    return dynamics.slides(state, vehicle)
