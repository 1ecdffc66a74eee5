"""Draws the pictures of docs/concepts, from formulas and from results of the program `signorini` (in the PATH or SIGNORINI_BINARY).

python docs/figures/concepts/draw.py [FOLDER]     # needs NumPy and matplotlib; FOLDER also gets them as PNG
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
TOP = HERE.parent.parent.parent
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#767676"
plt.rcParams.update(
    {
        "svg.fonttype": "none",
        "svg.hashsalt": "signorini",
        "font.family": "DejaVu Sans",
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "axes.grid": True,
        "grid.color": "#dddddd",
        "grid.linewidth": 0.6,
    }
)


def solve(problem):
    """The summary of a problem."""
    program = os.environ.get("SIGNORINI_BINARY", "signorini")
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / "p.json").write_text(json.dumps(problem))
        out = f"{folder}/out.summary.json"
        subprocess.run([program, "solve", f"{folder}/p.json", "-o", out], check=True, capture_output=True)
        return json.loads(pathlib.Path(out).read_text())


def profile(problem):
    """The columns of the profile as arrays."""
    program = os.environ.get("SIGNORINI_BINARY", "signorini")
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / "p.json").write_text(json.dumps(problem))
        subprocess.run([program, "solve", f"{folder}/p.json", "-o", f"{folder}/out.csv"], check=True, capture_output=True)
        return np.genfromtxt(f"{folder}/out.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")


def example(name, refine=None, **friction):
    problem = json.loads((TOP / "examples" / f"{name}.json").read_text())
    problem["contacts"][0]["friction"].update(friction)
    if refine is not None:
        problem["mesh"]["refine"] = refine
    return problem


def save(figure, name):
    figure.savefig(HERE / f"{name}.svg", metadata={"Date": None})
    if len(sys.argv) > 1:
        figure.savefig(pathlib.Path(sys.argv[1]) / f"{name}.png", dpi=130)
    plt.close(figure)


def bump(x, rho):
    """ω_ρ: a bell of unit integral that vanishes beyond ρ."""
    inside = np.abs(x) < rho
    out = np.zeros_like(x)
    out[inside] = np.exp(rho**2 / (x[inside] ** 2 - rho**2)) / (0.443993816168079 * rho)
    return out


def averaging():
    """The kernel, and what it makes of Hertz's pressure and of the pressure under a flat punch."""
    figure, axes = plt.subplots(1, 3, figsize=(7.5, 2.6), layout="constrained")
    x = np.linspace(-1.5, 1.5, 6001)
    step = x[1] - x[0]
    for rho, style in (0.1, ":"), (0.3, "--"), (0.6, "-"):
        axes[0].plot(x, bump(x, rho), style, color=BLUE, label=f"ρ = {rho}")
    axes[0].set(xlim=(-0.7, 0.7), xlabel="distance", title="weight ω_ρ")
    inside = np.abs(x) < 1
    hertz = np.where(inside, np.sqrt(np.clip(1 - x**2, 0, None)), 0)
    # the mean of the singular pressure over each step, so that its integral is exact
    edges = np.clip(np.concatenate([x - step / 2, [x[-1] + step / 2]]), -1, 1)
    punch = np.diff(np.arcsin(edges)) / step / np.pi
    for axis, pressure, title in (axes[1], hertz, "under a cylinder"), (axes[2], punch, "under a flat punch"):
        axis.plot(x, pressure, color=GREY, lw=1.2, label="p")
        for rho, style in (0.1, ":"), (0.3, "--"), (0.6, "-"):
            axis.plot(x, np.convolve(pressure, bump(x, rho) * step, "same"), style, color=BLUE, label=f"S_ρ, ρ = {rho}")
        axis.set(xlim=(0, 1.5), xlabel="s / a", title=title)
    axes[1].set(ylim=(0, 1.1))
    axes[2].set(ylim=(0, 1.6))
    axes[0].legend(fontsize=7)
    axes[2].legend(fontsize=7, loc="upper left")
    save(figure, "averaging")


def transition():
    """φ_ε, and the stress that it makes."""
    figure, axes = plt.subplots(1, 2, figsize=(7, 2.6), layout="constrained")
    r = np.linspace(0, 3, 301)
    axes[0].plot(r, np.minimum(r, 1), color=BLUE, label="linear")
    axes[0].plot(r, np.tanh(r), "--", color=ORANGE, label="tanh")
    axes[0].plot([0, 0, 3], [0, 1, 1], ":", color=GREY, label="ε → 0")
    axes[0].set(xlabel="slip |u_t − d| / ε", title="transition φ_ε", ylim=(0, 1.1))
    axes[0].legend(loc="lower right")
    e = np.linspace(-3, 3, 601)
    axes[1].plot(e, -np.clip(e, -1, 1), color=BLUE)
    axes[1].axvspan(-1, 1, color=GREEN, alpha=0.15, lw=0)
    axes[1].text(0, -0.93, "stick", ha="center", color=GREEN)
    axes[1].text(2, -0.6, "slip", ha="center", color=ORANGE)
    axes[1].text(-2, 0.6, "slip", ha="center", color=ORANGE)
    axes[1].set(xlabel="slip (u_t − d) / ε", title="tangential stress σ_t / τ on the body", ylim=(-1.15, 1.15))
    save(figure, "transition")


def radius():
    """σ_t under a punch for several ρ: Coulomb's law has no peak."""
    figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
    for rho, style in (0, ":"), (0.005, "-."), (0.01, "--"), (0.04, "-"):
        rows = profile(example("rectangular_punch", refine={"tolerance": 0.002}, nonlocal_radius=rho))
        axes.plot(
            rows["s"],
            rows["tangential_stress"],
            style,
            color=GREY if rho == 0 else BLUE,
            label="ρ = 0 (Coulomb)" if rho == 0 else f"ρ = {rho}",
        )
    axes.set(xlim=(0.38, 0.52), ylim=(0, 500), xlabel="arc length s (the punch ends at 0.5)", ylabel="tangential stress σ_t")
    axes.legend()
    save(figure, "radius")


def slip():
    """What ε does to the tangential force of two examples; the meshes are those of verification.md."""
    figure, axes = plt.subplots(figsize=(5, 2.8), layout="constrained")
    values = np.logspace(-6, -2, 13)
    for name, colour, style in ("rectangular_punch", BLUE, "-"), ("cylinder", ORANGE, "--"):
        force = [solve(example(name, refine=2, elastic_slip=float(e)))["tangential_force"] for e in values]
        axes.semilogx(values, np.array(force) / force[0], style, marker=".", color=colour, label=name.replace("_", " "))
    axes.set(xlabel="elastic slip ε (the contacts are 0.5 and 2.1 long)", ylabel="T / T at ε = 10⁻⁶", ylim=(0.75, 1.02))
    axes.legend(loc="lower left")
    save(figure, "slip")


def coarse():
    """Stress in the part that sticks, on a mesh that cannot follow a small ε and on a finer one."""
    figure, axes = plt.subplots(1, 2, figsize=(7, 2.7), layout="constrained", sharey=True)
    for axis, refine in zip(axes, (0, 2)):
        for slip_, colour, style in (1e-6, ORANGE, "-"), (1e-4, BLUE, "--"):
            problem = example("rectangular_punch", refine=refine, elastic_slip=slip_)
            rows = profile(problem)
            axis.plot(
                rows["s"], rows["tangential_stress"], style, marker=".", ms=3, lw=0.9, color=colour, label=f"ε = {slip_:g}"
            )
        axis.set(
            xlim=(0, 0.36),
            ylim=(-5, 40),
            xlabel="arc length s",
            title="mesh of 56 elements" if refine == 0 else "every element split twice",
        )
    axes[0].set(ylabel="tangential stress σ_t")
    axes[0].legend()
    save(figure, "coarse")


def laws():
    """σ_t under a cylinder by the total and by the incremental law."""
    figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
    for law, colour, style in ("total", ORANGE, "--"), ("incremental", BLUE, "-"):
        problem = example("cylinder", refine=4, history=law)
        if law == "incremental":
            problem["steps"] = [{"increments": 160, "spacing": "contact_width"}]
        rows = profile(problem)
        summary = solve(problem)
        contact = summary["contacts"]["top"]
        print(law, summary["accuracy"]["verdict"], summary["tangential_force"], contact["stick"], contact["contact"])
        axes.plot(rows["s"], rows["tangential_stress"], style, color=colour, label=f"{law} law")
    axes.plot(rows["s"], rows["friction_bound"], ":", color=GREY, label="friction bound τ")
    axes.set(xlim=(0, 2.4), ylim=(0, 60), xlabel="arc length s", ylabel="tangential stress σ_t")
    axes.legend()
    save(figure, "laws")


def edge():
    """The largest pressure and the force under a punch as the mesh is refined."""
    figure, axes = plt.subplots(figsize=(5, 2.8), layout="constrained")
    peaks, forces, friction = [], [], []
    for refine in range(5):
        summary = solve(example("rectangular_punch", refine=refine))
        peaks.append(-summary["contacts"]["top"]["peak_normal_stress"]["value"])
        friction.append(summary["contacts"]["top"]["peak_tangential_stress"]["value"])
        forces.append(summary["normal_force"])
    for values, label, colour, style in (
        (peaks, "peak of the pressure", ORANGE, "-"),
        (friction, "peak of σ_t, ρ = 0.01", GREEN, "-."),
        (forces, "normal force", BLUE, "--"),
    ):
        axes.semilogy(range(5), np.array(values) / values[0], style, marker="o", ms=4, color=colour, label=label)
    axes.set(
        xlabel="refinements: every element split into four", ylabel="value / value at first", xticks=range(5), ylim=(0.4, 6)
    )
    axes.legend(loc="upper left")
    print(
        "edge: peaks",
        [f"{v:.0f}" for v in peaks],
        "σ_t",
        [f"{v:.0f}" for v in friction],
        "forces",
        [f"{v:.2f}" for v in forces],
    )
    save(figure, "edge")


for draw in averaging, transition, radius, slip, coarse, edge, laws:  # the last takes a minute
    draw()
