"""Secrets in the environment of commands, which must not be found anywhere afterwards."""

from __future__ import annotations

from typing import Final

SECRET: Final = "s3cret-of-the-fleet"
PLANTED: Final = {
    "MOTION_MEMORY_AUTH": f"robot:{SECRET}",
    "AWS_SECRET_ACCESS_KEY": f"aws-{SECRET}",
    "SOME_API_KEY": f"key-{SECRET}",
    "OF_AN_ADDRESS": f"postgresql://robot:{SECRET}@10.0.0.5/db",
}
