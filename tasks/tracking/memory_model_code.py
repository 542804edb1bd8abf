"""All the code that MLflow stores for a memory's model; the rest is in the installed package."""

from mlflow.models import set_model

from tasks.tracking.memory_model import MemoryModel

set_model(MemoryModel())
