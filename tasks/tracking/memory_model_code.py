"""All the code that MLflow keeps of a memory's model; the rest is the installed package's."""

from mlflow.models import set_model

from tasks.tracking.memory_model import MemoryModel

set_model(MemoryModel())
