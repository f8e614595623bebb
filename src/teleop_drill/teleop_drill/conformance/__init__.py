"""Conformance: what CRTK asks of an arm, row by row, and what was found."""

from teleop_drill.conformance.findings_table import findings_json, findings_table
from teleop_drill.conformance.rows import ROWS, Finding, Group, Row, Verdict

__all__ = ["ROWS", "Finding", "Group", "Row", "Verdict", "findings_json", "findings_table"]
