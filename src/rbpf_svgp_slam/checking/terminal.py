"""Findings as a user reads them. Needs no ROS."""

from __future__ import annotations

import textwrap

from rbpf_svgp_slam.checking.findings import ERROR, OK, WARNING, Finding, count, plural, worst_first

_WIDTH = 100
_LABELS = {ERROR: "ERROR", WARNING: "warning", OK: "ok"}
_MARGIN = " " * 10  # below the label
_DETAIL = 12  # "likely cause"


def findings_text(findings: list[Finding]) -> str:
    """All findings, worst first, each with what is known of it."""
    width = max((len(finding.name) for finding in findings), default=0)
    return "\n".join(_text(finding, width) for finding in worst_first(findings))


def summary(bag: str, findings: list[Finding]) -> str:
    """One line."""
    errors, warnings = count(findings, ERROR), count(findings, WARNING)
    verdict = "SLAM would fail" if errors else "SLAM can run"
    return f"{bag}: {verdict}: {plural(errors, 'error')}, {plural(warnings, 'warning')}"


def _text(finding: Finding, width: int) -> str:
    head = f"{_LABELS[finding.severity]:<10}{finding.name:<{width}}  "
    lines = _wrapped(head, finding.value)
    if finding.severity == OK:
        return lines
    for label, text in (
        ("expected", finding.expected),
        ("likely cause", finding.cause),
        ("fix", finding.fix),
    ):
        if text:
            lines += "\n" + _wrapped(f"{_MARGIN}{'':<{width}}  {label:<{_DETAIL}}  ", text)
    return lines


def _wrapped(head: str, text: str) -> str:
    return textwrap.fill(
        text,
        max(_WIDTH, len(head) + 40),
        initial_indent=head,
        subsequent_indent=" " * len(head),
        break_long_words=False,
        break_on_hyphens=False,
    )
