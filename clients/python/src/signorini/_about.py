"""What figures and tables say of a result besides its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ._data import Summary
from ._style import parameters


def about(result: Summary, problem: Mapping[str, Any], step: int | str | None = None) -> dict[str, Any]:
    """Title, the law of friction (μ, ρ, ε by contact), verdict, warnings without notes, units, kind of analysis,
    the problem itself, extents; at the end of a step."""
    contacts = {contact["boundary"]: contact for contact in problem.get("contacts") or []}
    said = {
        "title": problem.get("title") or "",
        "parameters": {name: parameters(contact) for name, contact in contacts.items()},
        "units": problem.get("units") or {},
        "analysis": (problem.get("analysis") or {}).get("kind", ""),
        "problem": problem,
    }
    if step is not None and problem.get("steps"):
        names = [document["name"] for document in result.steps]
        number = names.index(step) if step in names else int(step) if str(step).isdigit() else len(names)
        if number >= len(names):
            # it has ended since this result was read, which says nothing of it
            return {**said, "step": str(step)}
        said["step"] = names[number]
        result = Summary(result.steps[number], False)
    return {
        **said,
        "verdict": result.verdict,
        "outcome": result.outcome,
        "warnings": [warning.code for warning in result.warnings if warning.severity != "note"],
        "extents": {name: {"stick": contact.stick, "slip": contact.slip} for name, contact in result.contacts.items()},
        "peaks": {
            name: {
                "normal_stress": contact.peak_normal_stress,
                "tangential_stress": contact.peak_tangential_stress,
            }
            for name, contact in result.contacts.items()
        },
    }


def obstacles(problem: Mapping[str, Any]) -> list[str]:
    """The boundaries of contacts with a rigid obstacle; without a condition there is only a prescribed friction."""
    contacts = [contact for contact in problem.get("contacts") or [] if contact.get("obstacle")]
    return [contact["boundary"] for contact in contacts if contact.get("condition") != "none"]
