"""A memory or a library as an MLflow model: problem JSON in; ranked, checked plans in its frame out.

The model is saved *from code*: it consists of the archive and ``memory_model_code.py``, which imports this
file from the installed package, and the wheel of that package. Nothing is pickled, and the archive is checked
like any other.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import mlflow
import pandas as pd
from mlflow.exceptions import MlflowException
from mlflow.models import ModelSignature
from mlflow.models.model import Model
from mlflow.protos.databricks_pb2 import INVALID_PARAMETER_VALUE
from mlflow.pyfunc import PyFuncModel, save_model
from mlflow.pyfunc.model import PythonModel, PythonModelContext
from mlflow.types import ColSpec, DataType, ParamSchema, ParamSpec, Schema
from mlflow.types.schema import Array

from planners.memory.library.plan_library import PlanLibrary
from planners.memory.memory import Memory, scale_fault
from planners.ranked_plans import ranked_plans
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Plan, Problem
from storage.archives.libraries import load_memory_or_library
from storage.errors import StorageError
from storage.exchange.problems import fields_of, problem_of
from storage.fields import parse_json
from storage.places.scratch import scratch_folder
from storage.vehicles.vehicle_files import said_vehicle
from tasks.tracking.own_wheel import write_wheel

CODE: Final = Path(__file__).with_name("memory_model_code.py")
ARTIFACT: Final = "memory"  # the archive, under this name in the model's context
WHEELS: Final = "code"  # the folder of a model where MLflow keeps the wheel of this package
TOP_K: Final = 5
MOST_CORNERS: Final = 10_000  # of all obstacles of a problem; other requests wait meanwhile
MOST_CORNERS_OF_ONE: Final = 1_000  # the time to cut a polygon into convex pieces grows with the square
_ROWS: Final = Array(Array(DataType.double))
SIGNATURE: Final = ModelSignature(
    inputs=Schema([ColSpec(DataType.string, "problem")]),
    outputs=Schema(
        [
            ColSpec(DataType.string, "problem_id"),
            ColSpec(DataType.long, "rank"),  # from 1
            ColSpec(DataType.long, "plan"),  # its number in the memory; -1: made of parts of several
            ColSpec(DataType.boolean, "free"),  # it solves the problem: checked exactly
            ColSpec(DataType.double, "score"),  # the encoder's, higher is better
            ColSpec(DataType.double, "dt"),  # seconds
            ColSpec(_ROWS, "states"),  # [T, S] in the problem's own frame
            ColSpec(_ROWS, "controls"),  # [T - 1, 2]
        ]
    ),
    params=ParamSchema([ParamSpec("top_k", DataType.long, TOP_K)]),
)


class MemoryModel(PythonModel):
    """Recalls plans: a row of the input is a problem as JSON text, a row of the output is a plan."""

    def load_context(self, context: PythonModelContext) -> None:
        """Load and check the archive. Raises StorageError if it is damaged."""
        self.open(Path(context.artifacts[ARTIFACT]), context.model_config["vehicle"])

    def open(self, archive: Path, vehicle: str) -> None:
        """Load and check an archive that need not be in MLflow, for the vehicle of this name."""
        self.vehicle = said_vehicle(vehicle)
        self.memory: Memory | PlanLibrary = load_memory_or_library(archive, self.vehicle)

    def predict(
        self,
        context: PythonModelContext,
        model_input: pd.DataFrame,
        params: dict[str, Any] | None = None,
    ) -> pd.DataFrame:
        """The ``top_k`` best plans for each problem, best first.

        There are none if the encoder says that none fits. From a library, and for a problem that is not
        canonical, there is at most one, a free plan: a stored drive that was moved to a pose at rest, or
        parts of stored plans.

        Raises MlflowException, with one line, if a problem is malformed or impossible.
        """
        return self.plans(model_input, params)

    def plans(self, model_input: pd.DataFrame, params: dict[str, Any] | None = None) -> pd.DataFrame:
        """Like ``predict``, without MLflow's context."""
        top_k = (params or {}).get("top_k", TOP_K)
        if top_k is None or top_k < 1:
            raise MlflowException(f"top_k is {top_k}: give 1 or more.", INVALID_PARAMETER_VALUE)
        rows = [
            row
            for number, text in enumerate(model_input["problem"], start=1)
            for row in self._ranked(self._problem(text, number), top_k)
        ]
        return pd.DataFrame(rows, columns=SIGNATURE.outputs.input_names())

    def _problem(self, text: object, number: int) -> Problem:
        try:
            if not isinstance(text, str):
                raise ValueError(f"it is {type(text).__name__}; give the text of a JSON object")
            fields = parse_json(text, "it")
            _refuse_too_many_corners(fields)
            problem = problem_of(fields, f"problem-{number}", self.vehicle)
            fault = scale_fault(self.memory, problem.scale)
            if fault is not None:
                raise ValueError(fault)
        except (StorageError, ValueError) as error:
            raise MlflowException(f"Problem {number}: {error}", INVALID_PARAMETER_VALUE) from None
        return problem

    def _ranked(self, problem: Problem, top_k: int) -> list[list[Any]]:
        return [
            [problem.id, rank, each.number, each.free, each.score, each.plan.dt, *_lists(each.plan)]
            for rank, each in enumerate(ranked_plans(self.memory, problem, top_k), start=1)
        ]


def _lists(plan: Plan) -> tuple[list[Any], list[Any]]:
    return plan.states.tolist(), plan.controls.tolist()


def pyfunc_of(model: MemoryModel) -> PyFuncModel:
    """Wrap a model as MLflow would load it, but with the installed code, not that beside the archive."""
    return PyFuncModel(Model(signature=SIGNATURE), model, predict_fn="plans")


def _refuse_too_many_corners(fields: object) -> None:
    """Raise ValueError if the polygons have so many corners that other requests would wait too long."""
    polygons = fields.get("obstacles") if isinstance(fields, Mapping) else None
    corners = (
        [len(polygon) for polygon in polygons if isinstance(polygon, list)]
        if isinstance(polygons, list)
        else []
    )
    if max(corners, default=0) > MOST_CORNERS_OF_ONE or sum(corners) > MOST_CORNERS:
        raise ValueError(
            f"obstacles have {sum(corners)} corners, one of them {max(corners)}; at most {MOST_CORNERS} and "
            f"{MOST_CORNERS_OF_ONE} are accepted: simplify them, or use the command `solve`"
        )


def save_memory_model(folder: Path, archive: Path, vehicle: str, model: Model) -> None:
    """Write a memory's archive into a new folder, with the files that MLflow needs to load it as a model.

    The wheel of this package is one of them, and named among the model's requirements, so that MLflow can
    install what the model needs wherever it is served.

    Args:
        folder: the folder to write; it must not exist.
        archive: the memory's folder.
        vehicle: the vehicle's name.
        model: MLflow's description of the model, which this fills.
    """
    driven = said_vehicle(vehicle)
    scale = load_memory_or_library(archive, driven).scales[0]
    example = replace(problem_class("trap", vehicle=driven).draw(0, 0), scale=scale)
    with scratch_folder() as scratch:
        wheel = write_wheel(scratch)
        save_model(
            folder,
            python_model=str(CODE),
            artifacts={ARTIFACT: str(archive)},
            model_config={"vehicle": vehicle},
            signature=SIGNATURE,
            input_example=pd.DataFrame({"problem": [json.dumps(fields_of(example, driven))]}),
            code_paths=[str(wheel)],
            pip_requirements=[f"{WHEELS}/{wheel.name}", f"mlflow=={mlflow.__version__}"],
            mlflow_model=model,
        )
