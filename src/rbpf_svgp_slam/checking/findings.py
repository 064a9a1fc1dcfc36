"""What is said of a bag: one finding for each thing that was looked at."""

from __future__ import annotations

from dataclasses import dataclass

#: SLAM would fail; it may do worse than it could; all is well. Worst first.
ERROR, WARNING, OK = SEVERITIES = ("error", "warning", "ok")


@dataclass(frozen=True)
class Finding:
    """Something that was looked at."""

    name: str  # for machines
    severity: str
    value: str  # what was found
    expected: str = ""
    cause: str = ""  # the likely one
    fix: str = ""


def worst_first(findings: list[Finding]) -> list[Finding]:
    """By severity; findings of one severity in their order."""
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


def count(findings: list[Finding], severity: str) -> int:
    """How many findings are of a severity."""
    return sum(finding.severity == severity for finding in findings)


def plural(number: int, noun: str) -> str:
    """1 gap, 2 gaps."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
