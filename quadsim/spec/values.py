"""The check of a setting's value; see quadsim.files.values."""

from __future__ import annotations

from quadsim.files.values import checked as checked
