"""Table: findings as a table for people, and as JSON for programs."""

import json
from collections.abc import Iterable

from rich.markup import escape
from rich.table import Table

from teleop_core.base.texts import one_line
from teleop_drill.conformance.crtk_topics import Finding, RowResult

_STYLES = {
    RowResult.OK: "green",
    RowResult.ABSENT: "dim",
    RowResult.SKIPPED: "yellow",
    RowResult.NOTED: "yellow",
    RowResult.FAILED: "bold red",
}


def exit_code(findings: Iterable[Finding]) -> int:
    """Exit code of the test: 1 if a row failed, else 3 if a row was not tried, which is no pass, else 0."""
    verdicts = {finding.verdict for finding in findings}
    return 1 if RowResult.FAILED in verdicts else 3 if RowResult.SKIPPED in verdicts else 0


def findings_table(namespace: str, findings: Iterable[Finding]) -> Table:
    """Table with a row for each finding."""
    table = Table(title=f"CRTK: {escape(namespace)}", title_justify="left")
    for name in ("topic", "needed", "found", "verdict", "note"):
        table.add_column(name)
    for finding in findings:
        style = _STYLES[finding.verdict]
        needed = "required" if finding.row.is_required else "optional"
        verdict = f"[{style}]{finding.verdict.value}[/]"
        found, note = (escape(one_line(text)) for text in (finding.found, finding.note))
        table.add_row(finding.row.name, needed, found, verdict, note)
    return table


def findings_json(namespace: str, findings: Iterable[Finding]) -> str:
    """The table as JSON: ``{"namespace": ..., "rows": [{"topic": ..., "verdict": ...}, ...]}``."""
    rows = [
        {
            "topic": finding.row.name,
            "type": finding.row.ros_type,
            "required": finding.row.is_required,
            "verdict": finding.verdict.name.lower(),
            "found": finding.found,
            "note": finding.note,
        }
        for finding in findings
    ]
    return json.dumps({"namespace": namespace, "rows": rows}, indent=2)
