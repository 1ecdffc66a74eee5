"""How figures look: sizes, fonts, colours; which texts are around them, and the limits of their axes.

The colours are those of Okabe and Ito, which people with any of the common kinds of colour blindness tell apart; what
differs in colour differs in line style or in words besides. The figures that the service draws have the same.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._extras import load

SIZES = {"column": (88 / 25.4, 7.0), "page": (160 / 25.4, 9.0), "slide": (254 / 25.4, 12.5)}
"""Width in inches and size of letters in points: a column of a journal (88 mm), a page, a slide of 16:9."""
SLIDE = 9 / 16
"""The height of a slide, as a part of its width."""
STYLES = ("full", "bare")
"""With title, parameters, verdict and warnings, or with none of these."""


@dataclass(frozen=True)
class Theme:
    ground: str
    ink: str
    faint: str
    normal: str = "#0072B2"
    tangential: str = "#D55E00"
    stick: str = "#009E73"
    slip: str = "#E69F00"
    obstacle: str = "#999999"
    good: str = "#007A5A"
    fair: str = "#996900"
    poor: str = "#C85000"


THEMES = {
    "light": Theme("#ffffff", "#1a1a1a", "#767676"),
    "dark": Theme(
        "#16181c",
        "#e8e8e8",
        "#969ca5",
        normal="#56B4E9",
        tangential="#FF8A3D",
        obstacle="#787c82",
        good="#009E73",
        fair="#F0C05A",
        poor="#FF8A3D",
    ),  # fmt: skip
}

QUANTITIES = {
    "normal_stress": r"normal stress  $\sigma_n$",
    "tangential_stress": r"tangential stress  $\sigma_t$",
    "friction_bound": r"friction bound  $\tau$",
    "nonlocal_pressure": r"averaged pressure  $S_\rho$",
    "normal_displacement": r"normal displacement  $u_n$",
    "tangential_displacement": r"tangential displacement  $u_t$",
    "gap": "gap before deformation",
    "friction_ratio": r"friction ratio  $\varphi$",
    "residual": "contact residual",
    "friction_residual": "friction residual",
    "von_mises": "von Mises stress",
    "stress_xx": r"stress  $\sigma_{xx}$",
    "stress_yy": r"stress  $\sigma_{yy}$",
    "stress_zz": r"stress  $\sigma_{zz}$",
    "stress_xy": r"stress  $\sigma_{xy}$",
    "stick_width": "width of stick",
    "slip_width": "width of slip",
    "contact_width": "width of contact",
    "contact_width_error": "error of the width of contact",
    "peak_normal_stress": r"peak of  $\sigma_n$",
    "peak_tangential_stress": r"peak of  $\sigma_t$",
}
"""The names of quantities on axes."""

PARAMETERS = {
    "coefficient": r"$\mu$",
    "nonlocal_radius": r"$\rho$",
    "elastic_slip": r"$\varepsilon$",
    "youngs_modulus": r"$E$",
    "poissons_ratio": r"$\nu$",
}
"""The usual symbols of parameters that studies vary."""

AXISYMMETRIC = {
    "stress_xx": r"stress  $\sigma_{rr}$",
    "stress_yy": r"stress  $\sigma_{zz}$",
    "stress_zz": r"hoop stress  $\sigma_{\theta\theta}$",
    "stress_xy": r"shear stress  $\sigma_{rz}$",
}
"""The names of quantities that are others in axisymmetry, where x is r and y is z."""

UNITS = {
    "length": (
        "nonlocal_radius elastic_slip indentation tangential_displacement thickness radius half_width center "
        "contact_width stick_width slip_width ux uy un ut"
    ).split(),
    "stress": (
        "youngs_modulus pressure cohesion shear_cap normal_stress tangential_stress friction_bound von_mises "
        "peak_normal_stress peak_tangential_stress"
    ).split(),
    "force": ["normal_force", "tangential_force", "friction_force"],
}
"""What of parameters and results has which unit."""

CURVES: list[tuple[Any, str]] = [
    ("-", "o"), ("--", "s"), ("-.", "D"), (":", "^"), ((0, (8, 2)), "v"), ((0, (5, 1, 1, 1, 1, 1)), "P"),
    ("-", "X"), ("--", "<"), ("-.", ">"), (":", "p"), ((0, (8, 2)), "h"), ((0, (5, 1, 1, 1, 1, 1)), "*"),
]  # fmt: skip
"""Dashes and marker of each curve of a figure, so that they differ without colours; no two of the twelve are alike."""

SYMBOLS = {"μ": r"$\mu$", "ρ": r"$\rho$", "ε": r"$\varepsilon$"}


@contextlib.contextmanager
def styled(size: str, theme: str, ax: Any = None, style: str = "full") -> Iterator[tuple[Any, float, Theme]]:
    """pyplot with our settings, the width of a figure in inches, and the theme. Raises ValueError for other names.

    ax: axes of the caller, whose own settings of letters and lines then hold
    """
    known: list[tuple[str, str, Iterable[str]]] = [
        ("size", size, SIZES), ("theme", theme, THEMES), ("style", style, STYLES)
    ]  # fmt: skip
    wrong = [
        f"{name} is one of {', '.join(names)}, not {given!r}" for name, given, names in known if given not in names
    ]
    if wrong:
        raise ValueError("; ".join(wrong))
    pyplot = load("matplotlib.pyplot", "plot")
    width, points = SIZES[size]
    if ax is not None:
        yield pyplot, float(panels(ax)[0].figure.get_figwidth()), THEMES[theme]
        return
    with pyplot.rc_context(settings(THEMES[theme], points)):
        yield pyplot, width, THEMES[theme]


def new(plt: Any, rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Any, Any]:
    """A new figure, and its axes as an array of rows and columns."""
    from ._paper import Figure

    figure, axes = plt.subplots(rows, columns, figsize=size, FigureClass=Figure, squeeze=False, **options)
    return figure, axes


Limits = tuple[float, float]


def limits(**given: Any) -> list[Limits | None]:
    """Limits of axes as they were given by name, or None. Raises ValueError that names all that are wrong."""
    found: list[Limits | None] = []
    wrong = []
    for name, value in given.items():
        try:
            low, high = (float(number) for number in value) if value is not None else (0.0, 1.0)
        except (TypeError, ValueError):
            low, high = np.nan, np.nan
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            wrong.append(f"{name} is two finite numbers, the smaller first, not {value!r}")
        found.append(None if value is None else (low, high))
    if wrong:
        raise ValueError("; ".join(wrong))
    return found


def panels(ax: Any, most: int = 2) -> list[Any]:
    """The axes that a caller has given: one, or a list or array of them. Raises ValueError where these are too many."""
    found = list(np.ravel(np.array(ax, dtype=object)))
    if not 1 <= len(found) <= most:
        raise ValueError(f"ax is one pair of axes{f' or {most} of them' if most > 1 else ''}, not {len(found)}")
    return found


def settings(theme: Theme, points: float) -> dict[str, Any]:
    thin = points / 12
    return {
        "font.family": "sans-serif",
        "font.size": points,
        "mathtext.fontset": "dejavusans",
        "axes.titlesize": points * 1.1,
        "axes.labelsize": points,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.linewidth": 0.8 * thin,
        "axes.edgecolor": theme.ink,
        "axes.labelcolor": theme.ink,
        "axes.facecolor": theme.ground,
        "axes.axisbelow": True,
        "figure.facecolor": theme.ground,
        "savefig.facecolor": theme.ground,
        "text.color": theme.ink,
        "xtick.color": theme.ink,
        "ytick.color": theme.ink,
        "xtick.labelsize": points * 0.9,
        "ytick.labelsize": points * 0.9,
        "xtick.major.width": 0.8 * thin,
        "ytick.major.width": 0.8 * thin,
        "lines.linewidth": 1.8 * thin,
        "hatch.linewidth": 0.5 * thin,
        "legend.frameon": False,
        "legend.fontsize": points * 0.9,
        "grid.color": theme.faint,
        "grid.linewidth": 0.4 * thin,
        "grid.alpha": 0.4,
    }


def parameters(contact: Mapping[str, Any]) -> dict[str, float | str]:
    """The numbers of the friction law by their symbols, and which law it is; empty without friction."""
    friction = contact.get("friction") or {}
    symbols = {"μ": "coefficient", "ρ": "nonlocal_radius", "ε": "elastic_slip"}
    found = {symbol: friction[name] for symbol, name in symbols.items() if friction.get(name) is not None}
    return {**found, "law": friction.get("history") or "total"} if friction else {}


def subtitle(about: Mapping[str, Any], boundary: str | None = None) -> str:
    """The parameters by which the figures of a study differ; of one contact or, on a line for each, of all of them."""
    contacts = about.get("parameters") or {}
    shown = {name: found for name, found in contacts.items() if boundary in (None, "", name)}
    parts = []
    for name, found in shown.items():
        law = [f"{found['law']} law"] if "law" in found else []
        numbers = [f"{SYMBOLS[symbol]} = {value:.4g}" for symbol, value in found.items() if symbol != "law"]
        text = "   ".join([*numbers, *law]) or "no friction"
        parts.append(f"{name}:  {text}" if len(contacts) > 1 else text)
    if about.get("step") is not None:
        parts[-1:] = ["      ".join([*parts[-1:], f"load step {about['step']}"])]
    return "\n".join(parts)


def unit(about: Mapping[str, Any], kind: str) -> str:
    """` (MPa)` where the problem names its units, else nothing."""
    name = (about.get("units") or {}).get(kind)
    return f"  ({name})" if name else ""


def unit_of(about: Mapping[str, Any], name: str) -> str:
    """The unit of a parameter or a result where the problem names its units, else nothing."""
    last = name.rpartition(".")[2].rpartition("/")[2]
    kind = next((kind for kind, names in UNITS.items() if last in names), "")
    units = about.get("units") or {}
    found = str(units.get(kind) or "")
    if found and kind == "force" and about.get("analysis") == "plane_strain":
        # of a unit of thickness
        return f"{found}/{units['length']}" if units.get("length") else ""
    return found


def coordinates(about: Mapping[str, Any]) -> tuple[str, str]:
    """The names of the coordinates."""
    return ("r", "z") if about.get("analysis") == "axisymmetric" else ("x", "y")


def quantity_name(about: Mapping[str, Any], name: str) -> str:
    """The name of a quantity on an axis."""
    own = AXISYMMETRIC if about.get("analysis") == "axisymmetric" else {}
    return own.get(name) or QUANTITIES.get(name) or name.replace("_", " ")
