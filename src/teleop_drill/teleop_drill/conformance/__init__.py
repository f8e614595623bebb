"""Conformance: the requirements of CRTK on an arm, row by row, with the result of each test."""

from teleop_drill.conformance.crtk_topics import CRTK_TOPICS, CrtkTopic, Finding, Group, RowResult
from teleop_drill.conformance.findings_table import exit_code, findings_json, findings_table

__all__ = ["CRTK_TOPICS", "CrtkTopic", "Finding", "Group", "RowResult", "exit_code", "findings_json", "findings_table"]
