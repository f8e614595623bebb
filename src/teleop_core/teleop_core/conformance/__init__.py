"""Conformance: what CRTK asks of an arm, row by row, and what was found."""

from teleop_core.conformance.rows import ROWS, Finding, Group, Row, Verdict
from teleop_core.conformance.table import findings_json, findings_table

__all__ = [
    "ROWS", "Finding", "Group", "Row", "Verdict", "findings_json", "findings_table",
]  # fmt: skip
