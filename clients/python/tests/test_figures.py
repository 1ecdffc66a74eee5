"""Figures: that they say what they should, in every size and theme; how they look is for eyes."""

from __future__ import annotations

import dataclasses
import io
import math
import pathlib
import pickle
import re
from typing import Any

import numpy as np
import pytest
from conftest import unconverged_problem

import signorini as sg
from signorini import _shapes as shapes
from signorini import figures
from signorini import problem as p
from signorini._around import MOST_CURVES
from signorini._html import job as job_card
from signorini._style import CURVES
from signorini.pointer import differences

pytest.importorskip("matplotlib")


def words(figure: Any) -> str:
    """All text of a figure. It is not drawn for that, which would take most of the time of these tests."""
    from matplotlib.text import Text

    return "\n".join(text.get_text() for text in figure.findobj(Text))


def test_a_figure_is_saved_in_the_formats_of_papers(punch: sg.Result) -> None:
    figure = punch.plot_profile(size="column")
    for kind, begin in [("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")]:
        out = io.BytesIO()
        figure.savefig(out, format=kind, dpi=60)
        assert out.getvalue().startswith(begin)


def test_letters_stay_letters_and_pixels_are_as_many_as_on_paper(punch: sg.Result) -> None:
    figure = pickle.loads(pickle.dumps(punch.plot_profile(size="column")))
    saved = {}
    for kind in ("pdf", "svg", "png"):
        out = io.BytesIO()
        figure.savefig(out, format=kind)
        saved[kind] = out.getvalue()
    assert b"/Type3" not in saved["pdf"] and b"/CIDFontType2" in saved["pdf"], "Type 42"
    assert b"arc length" in saved["svg"] and saved["svg"].count(b"<text") > 20
    width = int.from_bytes(saved["png"][16:20], "big")
    assert width == pytest.approx(88 / 25.4 * 300, abs=1)


@pytest.mark.parametrize(("size", "theme"), [("column", "light"), ("page", "dark"), ("slide", "light")])
def test_a_profile_says_what_it_shows(punch: sg.Result, size: str, theme: str) -> None:
    figure = punch.plot_profile(size=size, theme=theme)
    text = words(figure)
    for word in (
        "Rectangular punch, thesis 4.1(i)",
        "verdict: ",
        "stick",
        "slip",
        "which grows on finer meshes",
        "Warnings: ",
    ):
        assert word in text, word
    assert figure.axes[0].get_title(loc="left") == r"$\mu$ = 0.3   $\rho$ = 0.01   $\varepsilon$ = 0.0001   total law"
    assert figure.axes[0].get_ylabel() == r"normal stress  $\sigma_n$"
    assert figure.get_figwidth() == pytest.approx({"column": 88, "page": 160, "slide": 254}[size] / 25.4)


def test_the_other_figures_of_a_result(punch: sg.Result) -> None:
    assert "friction residual" in words(punch.history.plot()) and "tolerance" in words(punch.history.plot())
    fields = punch.fields()
    assert "von Mises stress" in words(fields.plot(title="Another title"))
    signed = fields.plot(quantity="stress_yy", scale=2, zoom=True)
    assert signed.axes[1].get_ylabel() == r"stress  $\sigma_{yy}$"
    assert "contact, displacements × 2" in words(signed)
    both = fields.plot(size="slide")
    assert [axes.get_xlabel().split("\n")[1] for axes in both.axes[:2]] == [
        "displacements to scale",
        "contact, displacements to scale",
    ]
    assert "obstacle" in words(both) and len(fields.plot(zoom=False).axes) == 2  # with the bar of colours
    figures.deformed(dataclasses.replace(fields, contact_state=np.full(len(fields.points), -1)), zoom=True)
    with pytest.raises(ValueError, match="quantity is one of von_mises, stress_xx"):
        fields.plot(quantity="stress")
    for wrong in ({"size": "poster"}, {"theme": "blue"}):
        with pytest.raises(ValueError, match=f"{next(iter(wrong))} is one of"):
            punch.plot_profile(**wrong)


def test_the_obstacle_touches_the_body_where_they_are_in_contact(punch: sg.Result) -> None:
    fields = punch.fields()
    for scale in (1.0, 50.0):
        face, outward = shapes.obstacle_after(fields, fields.profiles["top"], scale)
        touching = (fields.points + scale * fields.displacement)[fields.contact_state > 0, :2]
        apart = np.linalg.norm(touching[:, None] - face[None], axis=2).min(axis=1)
        assert apart.max() < 1e-9 * scale
        np.testing.assert_allclose(outward, [[0, 1]] * len(face), atol=1e-12)


def test_an_obstacle_with_normals_of_its_own_touches_too(client: sg.Client) -> None:
    problem = sg.examples.rectangular_punch(refine=0)
    contact = problem.contacts[0]
    contact.obstacle = p.Wedge(angle=20)
    contact.normal, contact.indentation = "obstacle", 0.1
    fields = client.submit(problem).wait(60, progress=False).fields()
    face, _ = shapes.obstacle_after(fields, fields.profiles["top"], 1)
    touching = (fields.points + fields.displacement)[fields.contact_state > 0, :2]
    apart = np.linalg.norm(touching[:, None] - face[None], axis=2).min(axis=1)
    assert len(touching) and apart.max() < 1e-9
    assert words(fields.plot()).count("obstacle") == 1


def test_a_contact_at_one_node_is_shown_with_its_neighbours(punch: sg.Result) -> None:
    fields = punch.fields()
    state = np.minimum(fields.contact_state, 0)
    state[np.flatnonzero(fields.contact_state > 0)[0]] = 1
    one = dataclasses.replace(fields, contact_state=state)
    view = figures._views(one, None, None)[-1]
    assert view.contact and view.width > 0
    assert figures._usual(one, one.von_mises, view) > np.median(one.von_mises) / 10


def test_a_step_of_a_job_that_failed_later_is_not_partial(client: sg.Client) -> None:
    problem = unconverged_problem()
    problem.steps = [sg.problem.Step(name="light", indentation=0.0), sg.problem.Step(name="heavy")]
    job = client.submit(problem)
    with pytest.raises(sg.JobFailed):
        job.wait(60, progress=False)
    result = job.result(partial=True)
    assert "PARTIAL" in words(result.plot_profile())
    assert "PARTIAL" not in words(result.plot_profile(step="light"))
    # one that had not ended when the result was read
    later = dataclasses.replace(result.profile(step="light"), about=result._about("later"))
    assert "load step later" in words(later.plot())


def test_small_displacements_are_drawn_larger(client: sg.Client) -> None:
    problem = sg.examples.sheet(refine=0)
    problem.contacts[0].indentation /= 100
    fields = client.submit(problem).wait(60, progress=False).fields()
    factor = fields.plot(zoom=False).axes[0].get_xlabel().split("× ")[1]
    size, largest = np.ptp(fields.points, axis=0).max(), np.linalg.norm(fields.displacement, axis=1).max()
    assert factor.strip("0") in "125" and 0.04 < float(factor) * largest / size <= 0.1


def test_a_figure_of_a_load_step_says_what_was_then(client: sg.Client) -> None:
    problem = sg.examples.rectangular_punch(refine=0)
    problem.steps = [
        sg.problem.Step(name="press"),
        sg.problem.Step(name="lift", indentation=-1.0),
    ]
    result = client.submit(problem).wait(60, progress=False)
    pressed, lifted = result.profile(step="press"), result.profile(step=1)
    assert pressed.about["extents"]["top"]["slip"] and not lifted.about["extents"]["top"]["slip"]
    text = words(result.plot_profile(step="press"))
    assert "load step press" in text and "slip" in text
    assert "load step lift" in words(lifted.plot()) and "load step" not in words(result.plot_profile())


def test_a_partial_result_says_so(client: sg.Client) -> None:
    job = client.submit(unconverged_problem())
    with pytest.raises(sg.JobFailed):
        job.wait(60, progress=False)
    result = job.result(partial=True)
    for figure in (result.plot_profile(), result.history.plot(), result.fields().plot()):
        assert "PARTIAL: not converged" in words(figure)
    assert "Partial result: the iteration did not end" in result._repr_html_()
    assert "failure" in job_card(job) and "not_converged" not in job_card(job).split("warning")[0]


def test_a_sloping_boundary_has_x_beside_s_and_units(client: sg.Client) -> None:
    problem = sg.examples.sheet(refine=1)
    problem.units = p.Units(length="mm", stress="MPa")
    problem.steps = [p.Step(name="a", increments=2), p.Step(name="b", indentation=1.5)]
    result = client.submit(problem).wait(60, progress=False)
    text = words(result.plot_profile())
    assert "(MPa)" in text and "position" in text and "along “taper”" in text
    result.history.plot()


def test_without_friction(client: sg.Client) -> None:
    problem = sg.examples.cylinder(refine=0)
    problem.contacts[0].friction = None
    result = client.submit(problem).wait(60, progress=False)
    assert "no friction" in words(result.plot_profile()) and "friction bound" not in words(result.plot_profile())


def test_several_contacts_are_told_apart(client: sg.Client) -> None:
    problem = sg.examples.rectangular_punch(refine=0)
    other = p.Contact(boundary="right", obstacle=p.Flat(along="arc_length"), indentation=-1)
    problem.contacts.append(other)
    result = client.submit(problem).wait(60, progress=False)
    with pytest.raises(ValueError, match="which contact"):
        result.plot_profile()
    figure = result.plot_profile("top")
    assert figure.axes[0].get_title(loc="left").startswith("top:  ")
    result.plot_profile("right")


@pytest.mark.parametrize("name", sg.examples.__all__)
def test_the_examples_are_drawn(name: str) -> None:
    problem = getattr(sg.examples, name)()
    text = words(problem.plot())
    # an elastic body is drawn by its own lines
    rigid = problem.contacts[0].obstacle is not None
    assert ("obstacle, pushed by" in text) == rigid and problem.title in text


OBSTACLES: list[p.Obstacle] = [
    p.Flat(from_=0.2, to=0.8),
    p.Circle(radius=0.3, center=0.5),
    p.Parabola(radius=2),
    p.Wedge(angle=10, center=0.5),
    p.Cone(angle=45),
    p.Tilted(slope=-0.1, along="arc_length"),
    p.Power(coefficient=2, exponent=3),
    p.RoundedFlat(half_width=0.1, radius=0.2, center=0.5),
    p.Table(x=[0.1, 0.9], gap=[0, 0.5]),
    p.Polyline(points=[[0, 1.1], [1, 1.2]]),
    p.Line(point=[0.5, 1], angle=30),
]


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=lambda obstacle: obstacle.kind)
def test_every_obstacle_is_drawn(obstacle: p.Obstacle) -> None:
    problem = p.Problem(
        title="Every obstacle",
        analysis=p.PlaneStrain(),
        mesh=p.MeshInput(
            grid=p.Grid(x=[0, 0.5, 1], y=[0, 1]), boundaries={"upper": p.BoundaryPart(side="right", y=[0, 1])}
        ),
        materials=[p.Material(youngs_modulus=1, poissons_ratio=0)],
        contacts=[p.Contact(boundary="top", obstacle=obstacle)],
        loads=[p.Load(boundary="upper", pressure=1)],
        supports=[p.Support(boundary="bottom", uy=0), p.Support(nodes="unknown", ux=0)],
    )
    assert "obstacle, pushed by 0" in words(problem.plot(size="column"))
    face = shapes.obstacle(problem.mesh, problem.contacts[0])
    assert len(face) > 1 and np.all(np.isfinite(face))


def test_profiles_of_obstacles() -> None:
    c = np.array([-2.0, 0.0, 1.0])
    expected: dict[int, list[float]] = {
        0: [0, 0, 0],
        2: [1, 0, 0.25],
        4: [2, 0, 1],
        5: [0.2, 0, -0.1],
        6: [16, 0, 2],
    }
    for number, values in expected.items():
        np.testing.assert_allclose(shapes.profile(OBSTACLES[number], c), values, atol=1e-12)
    np.testing.assert_allclose(shapes.profile(p.Circle(radius=2), c), [2, 0, 2 - math.sqrt(3)])
    rounded = p.RoundedFlat(half_width=0.5, radius=1)
    np.testing.assert_allclose(shapes.profile(rounded, c), [np.nan, 0, 1 - math.sqrt(0.75)])
    with pytest.raises(TypeError):
        shapes.profile(p.Line(point=[0, 0], angle=0), c)


def test_an_inline_mesh_is_drawn_and_a_file_is_not() -> None:
    inline = p.InlineMesh(
        nodes=[[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]],
        elements=[[0, 1, 2, 3, 4, 5, 6, 7]],
        boundaries={"top": [[3, 2, 6]]},
    )
    mesh = p.MeshInput(inline=inline)
    np.testing.assert_array_equal(shapes.boundary(mesh, "top"), [[0, 1], [0.5, 1], [1, 1]])
    np.testing.assert_array_equal(shapes.normals(shapes.boundary(mesh, "top")), [[0, 1]] * 3)
    part = p.MeshInput(inline=inline, boundaries={"up": p.BoundaryPart(normal=[0, 1])})
    assert len(shapes.boundary(part, "up")) == 0
    assert len(shapes.obstacle(part, p.Contact(boundary="up", obstacle=p.Flat()))) == 0
    problem = sg.examples.rectangular_punch()
    problem.mesh = mesh
    assert "may touch: top" in words(problem.plot())
    problem.mesh = p.MeshInput(gmsh="$MeshFormat")
    with pytest.raises(ValueError, match="the mesh is in a file"):
        problem.plot()


def test_a_profile_without_peaks_is_not_cut(punch: sg.Result) -> None:
    profile = punch.profile()
    flat = dataclasses.replace(profile, normal_stress=np.zeros(len(profile)), about={})
    assert "peak" not in words(flat.plot(title=""))


def test_cards_of_notebooks(client: sg.Client, punch: sg.Result) -> None:
    job = client.submit(sg.examples.rectangular_punch(refine=0), name="<b>bold</b>", labels={"a": "&"})
    job.wait(60, progress=False)
    card = job._repr_html_()
    assert "&lt;b&gt;bold&lt;/b&gt;" in card and "a=&amp;" in card and "<b>bold" not in card
    assert "from the cache" in card and "succeeded" in card
    running = sg.Job(client, {**job.document, "progress": {"residual": 1e-3, "tolerance": 1e-10, "iteration": 3}})
    assert "1.0e-03 → 1e-10" in running._repr_html_()
    table = punch._repr_html_()
    assert "normal force" in table and "±" in table and "peak σₙ" in table
    sweep = client.sweep(sg.examples.rectangular_punch(refine=0), {"contacts.0.indentation": [0.1, 0.2]})
    assert "contacts/0/indentation" in sweep.wait(60, progress=False)._repr_html_()


def overlapping(figure: Any) -> list[tuple[str, str]]:
    """Pairs of texts of a figure that lie on one another."""
    from matplotlib.text import Text

    figure.savefig(io.BytesIO(), format="png", dpi=figure.dpi)  # which places everything
    boxes = []
    for text in figure.findobj(Text):
        lines = text.get_text().rstrip("\n")
        # words alone: numbers of axes are there also beyond their limits
        if re.search("[a-z]{3}", lines.replace("mathdefault", "")) and text.get_visible():
            box = text.get_window_extent()
            empty = (text.get_text().count("\n") - lines.count("\n")) / (text.get_text().count("\n") + 1)
            boxes.append((lines, box.from_extents(box.x0 + 1, box.y0 + empty * box.height + 1, box.x1 - 1, box.y1 - 1)))
    return [(a[0], b[0]) for n, a in enumerate(boxes) for b in boxes[:n] if a[1].overlaps(b[1]) and a[0] != b[0]]


@pytest.fixture(scope="module")
def two_contacts(client: sg.Client) -> sg.Result:
    problem = sg.examples.rectangular_punch(refine=0)
    friction = p.Friction(coefficient=0.25, nonlocal_radius=0.05, elastic_slip=1e-4)
    obstacle = p.Flat(along="arc_length", from_=0.2, to=2)
    problem.contacts.append(p.Contact(boundary="right", obstacle=obstacle, indentation=0.02, friction=friction))
    return client.submit(problem, name="two").wait(60, progress=False)


@pytest.mark.parametrize("size", ["column", "page", "slide"])
def test_two_contacts_have_their_parameters_without_overlap(two_contacts: sg.Result, size: str) -> None:
    drawn = [
        two_contacts.plot_profile("top", size=size),
        two_contacts.plot_profile("right", size=size),
        two_contacts.history.plot(size=size),
        two_contacts.fields().plot(size=size),
        two_contacts.job.problem().plot(size=size),
    ]
    for figure in drawn:
        assert not overlapping(figure)
    for figure in drawn[2:]:
        title = figure.axes[0].get_title(loc="left")
        assert [line.partition(":")[0] for line in title.splitlines()] in (["top", "right"], ["right", "top"])


def test_figures_on_axes_of_ones_own(two_contacts: sg.Result, client: sg.Client) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 4, figsize=(20, 10), layout="constrained")
    size = plt.rcParams["font.size"]
    history, fields = two_contacts.history, two_contacts.fields()
    study = client.sweep(sg.examples.sheet(refine=0), {"contacts.0.friction.coefficient": [0.1, 0.2]})
    table = study.wait(60, progress=False).table()
    for drawn in (
        two_contacts.plot_profile("top", ax=axes[0, 0]),
        two_contacts.plot_profile("right", ax=axes[:, 1]),
        history.plot(ax=axes[0, 2]),
        fields.plot(ax=axes[1, 0], zoom=True),
        two_contacts.job.problem().plot(ax=[axes[1, 2]]),
        table.plot("normal_force", ax=axes[0, 3], title="a study"),
    ):
        assert drawn is figure
    assert len(figure.axes) == 9, "eight, and a bar of colours"
    assert axes[0, 0].get_ylabel() == "stress on the body" and axes[1, 1].get_ylabel().startswith("tangential stress")
    legend = axes[0, 0].get_legend()
    assert legend is not None and len(legend.get_texts()) == 3
    assert "verdict: " in axes[0, 0].get_title(loc="left") and axes[0, 3].get_title(loc="left") == "a study"
    assert not figure.get_suptitle() and figure.get_supxlabel() == "" and plt.rcParams["font.size"] == size
    assert plt.fignum_exists(figure.number), "it is the caller's to close"
    history.plot(ax=axes[:, 3])
    assert not overlapping(figure)
    with pytest.raises(ValueError, match="ax is one pair of axes or 2 of them, not 8"):
        two_contacts.plot_profile("top", ax=axes)
    with pytest.raises(ValueError, match="ax is one pair of axes, not 2"):
        table.plot("normal_force", ax=axes[:, 0])
    plt.close(figure)


def test_a_study_over_words_and_obstacles(client: sg.Client) -> None:
    obstacles = [p.Flat(to=0.5), p.Parabola(radius=8, to=0.5), p.Wedge(angle=3, to=0.5)]
    axes = {"contacts.0.friction.kernel": ["bump", "parabola"], "contacts.0.obstacle": obstacles}
    table = client.sweep(sg.examples.rectangular_punch(refine=0), axes, name="shapes").wait(60, False).table()
    for size in ("column", "page"):
        (drawn,) = table.plot("tangential_force", x="obstacle", size=size).axes
        labels = [" ".join(text.get_text().split()) for text in drawn.get_xticklabels()]
        assert labels == ["flat to 0.5", "parabola radius 8 to 0.5", "wedge angle 3 to 0.5"]
        assert [line.get_xdata().tolist() for line in drawn.lines[:1]] == [[0, 1, 2]]  # type: ignore[union-attr]
        other = table.plot("tangential_force", x="kernel", size=size)
        assert [text.get_text() for text in other.axes[0].get_xticklabels()] == ["bump", "parabola"]
        assert "obstacle = parabola radius 8 to 0.5" in words(other) and not overlapping(other)
    # without a column of numbers the one with the most words is the axis
    assert table.plot("tangential_force").axes[0].get_xlabel() == "obstacle"
    whole = client.sweep(sg.examples.sheet(refine=0), {"solver.max_iterations": range(150, 153)}).wait(60, False)
    ticks = whole.plot("normal_force").axes[0].get_xticks()
    assert np.array_equal(ticks, np.round(ticks))


def test_errors_of_a_column_are_bars(client: sg.Client) -> None:
    study = client.sweep(sg.examples.cylinder(refine=0), {"contacts.0.indentation": [0.05, 0.1]})
    table = study.wait(60, progress=False).table()
    (axes,) = table.plot("contact_width").axes
    (bars,) = axes.collections
    heights = [float(np.ptp(bar[:, 1])) for bar in bars.get_segments()]  # type: ignore[attr-defined]
    assert heights == pytest.approx(2 * table["contact_width_error"]) and min(heights) > 0
    assert not table.plot("normal_force").axes[0].collections


def test_the_legend_of_a_column_lies_below_its_panels(punch: sg.Result) -> None:
    figure = punch.plot_profile(size="column")
    figure.savefig(io.BytesIO(), format="png", dpi=figure.dpi)
    legend = figure.axes[1].get_legend()
    assert legend is not None and [text.get_text() for text in legend.get_texts()] != []
    panels = [axes.get_window_extent() for axes in figure.axes]
    assert not any(legend.get_window_extent().overlaps(panel) for panel in panels) and not overlapping(figure)


def test_a_bare_figure_has_nothing_around_it(punch: sg.Result, client: sg.Client) -> None:
    fields, problem = punch.fields(), punch.job.problem()
    study = client.sweep(sg.examples.sheet(refine=0), {"contacts.0.friction.coefficient": [0.1, 0.2]})
    table = study.wait(60, progress=False).table()
    for figure in (
        punch.plot_profile(style="bare"),
        punch.history.plot(style="bare"),
        fields.plot(style="bare"),
        problem.plot(style="bare"),
        table.plot("normal_force", style="bare"),
        figures.profiles([punch, punch], style="bare"),
    ):
        text = words(figure)
        for word in ("Rectangular punch", "verdict", "Warnings", "warnings:", r"$\mu$ = 0.3", "finer meshes", study.id):
            assert word not in text, word
    assert "peak" in words(punch.plot_profile(style="bare")), "where the axis ends before the peak, its value stays"
    with pytest.raises(ValueError, match="size is one of column, page, slide, not 'a'; style is one of full, bare"):
        punch.plot_profile(size="a", style="b")


def test_limits_of_axes(punch: sg.Result) -> None:
    figure = punch.plot_profile(xlim=(0.3, 0.45), ylim=(-300, 10), ylim_below=[-5, 90])
    assert [axes.get_xlim() for axes in figure.axes] == [(0.3, 0.45)] * 2
    assert [axes.get_ylim() for axes in figure.axes] == [(-300, 10), (-5, 90)]
    drawn = np.asarray(figure.axes[0].lines[0].get_xdata())
    assert drawn[0] <= 0.3 <= drawn[1] and drawn[-2] <= 0.45 <= drawn[-1], "a node beyond at each end"
    history = punch.history.plot(xlim=(1, 5), ylim=(1e-8, 1), ylim_below=(0, 50))
    assert history.axes[0].get_ylim() == (1e-8, 1) and history.axes[1].get_ylim() == (0, 50)
    (body, _) = punch.fields().plot(xlim=(0.2, 0.6), ylim=(-0.5, 0.1)).axes
    assert (body.get_xlim(), body.get_ylim()) == ((0.2, 0.6), (-0.5, 0.1))
    (mesh,) = punch.job.problem().plot(xlim=(0, 1), ylim=(-1, 0.2)).axes
    assert (mesh.get_xlim(), mesh.get_ylim()) == ((0, 1), (-1, 0.2))
    with pytest.raises(
        ValueError, match=r"xlim is two finite numbers.* not \(2, 1\); ylim is two .* not 'a'; ylim_below is"
    ):
        punch.plot_profile(xlim=(2, 1), ylim="a", ylim_below=(0, math.inf))
    with pytest.raises(ValueError, match="ylim: the axis of residuals is logarithmic"):
        punch.history.plot(ylim=(0, 1))
    with pytest.raises(ValueError, match=r"xlim: the contact lies between 0 and "):
        punch.plot_profile(xlim=(50, 60))


def test_a_profile_shows_the_contact_or_all_of_the_boundary(client: sg.Client) -> None:
    found = client.submit(sg.examples.cylinder(refine=0)).wait(60, progress=False).profile()
    loaded = found.s[found.normal_stress != 0]
    left, right = found.plot().axes[0].get_xlim()
    assert left == found.s[0] and loaded[-1] < right < found.s[-1]
    assert found.plot(zoom=False).axes[0].get_xlim() == (found.s[0], found.s[-1])


@pytest.mark.parametrize("name", ["profile", "history", "fields", "problem", "profiles", "study"])
def test_a_slide_is_16_to_9(punch: sg.Result, client: sg.Client, name: str) -> None:
    study = client.sweep(sg.examples.sheet(refine=0), {"contacts.0.friction.coefficient": [0.1, 0.2]})
    drawn = {
        "profile": lambda: punch.plot_profile(size="slide"),
        "history": lambda: punch.history.plot(size="slide"),
        "fields": lambda: punch.fields().plot(size="slide"),
        "problem": lambda: punch.job.problem().plot(size="slide"),
        "profiles": lambda: figures.profiles([punch, punch], size="slide"),
        "study": lambda: study.wait(60, progress=False).plot("normal_force", size="slide"),
    }[name]()
    width, height = drawn.get_size_inches()
    assert (width, height) == pytest.approx((254 / 25.4, 254 / 25.4 * 9 / 16))
    assert not overlapping(drawn)


def test_several_jobs_are_told_apart_by_what_differs(client: sg.Client) -> None:
    base = sg.examples.rectangular_punch(refine=0)
    base.units = p.Units(length="mm", force="N", stress="MPa")
    values = [(0.01, 0.3), (0.02, 0.3), (0.02, 0.2)]
    places = ("contacts.0.friction.nonlocal_radius", "contacts.0.friction.coefficient")
    jobs = [client.submit(base.with_values(dict(zip(places, value, strict=True)))) for value in values]
    results = [job.wait(60, progress=False) for job in jobs]
    figure = figures.profiles(results)
    handles, labels = figure.axes[1].get_legend_handles_labels()
    assert labels == [rf"$\mu$ = {mu}, $\rho$ = {rho} mm" for rho, mu in values]
    dashes: list[Any] = list(handles)
    assert len({line.get_linestyle() for line in dashes}) == 3, "not by colour alone"
    legend = figure.axes[1].get_legend()
    assert legend is not None and len(legend.get_texts()) == 3
    assert figure.axes[0].get_title(loc="left") == r"$\varepsilon$ = 0.0001   total law", "what all have in common"
    assert "(MPa)" in figure.axes[0].get_ylabel() and "verdict: " in words(figure)
    assert not overlapping(figure)
    # jobs and profiles will do, and labels of one's own
    same = figures.profiles([jobs[0], results[1].profile()], labels=["a", "b"], xlim=(0.2, 0.5), ylim=(-900, 0))
    assert same.axes[0].get_legend_handles_labels()[1] == ["a", "b"] and same.axes[0].get_ylim() == (-900, 0)
    assert figures.profiles(results[:1] * 2).axes[0].get_legend_handles_labels()[1] == ["(no. 1)", "(no. 2)"]
    for wrong, message in [
        (([],), "1 to 12 curves, not 0"),
        ((results * 5,), "1 to 12 curves, not 15"),
    ]:
        with pytest.raises(ValueError, match=message):
            figures.profiles(*wrong)
    with pytest.raises(ValueError, match="there are 1 labels for 3 jobs"):
        figures.profiles(results, labels=["a"])
    with pytest.raises(TypeError, match="expected jobs, results or profiles, not str"):
        figures.profiles(["job_1"])


def test_load_steps_of_a_job_and_other_meshes_are_told_apart(client: sg.Client) -> None:
    problem = sg.examples.rectangular_punch(refine=0)
    problem.steps = [p.Step(name="press"), p.Step(name="lift", indentation=0.5)]
    result = client.submit(problem).wait(60, progress=False)
    steps = figures.profiles([result.profile(step="press"), result.profile(step="lift"), result])
    labels = steps.axes[0].get_legend_handles_labels()[1]
    assert labels == ["load step press", "load step lift", "last load step"]
    finer = client.submit(problem.with_values({"mesh.refine": 1})).wait(60, progress=False)
    other = figures.profiles([result, finer]).axes[0].get_legend_handles_labels()[1]
    assert other == ["refine = 0", "refine = 1"] or other == ["without refine", "refine = 1"]


def test_differences_of_documents() -> None:
    a = {"x": [1, 2, 3, 4], "y": {"k": 1, "l": "a"}, "z": [1]}
    b = {"x": [1, 2, 3, 5], "y": {"k": 1}, "z": [1, 2]}
    assert differences([a, b]) == {"/x/3": [4, 5], "/y/l": ["a", None], "/z": [[1], [1, 2]]}
    assert differences([{"x": [1, 2, 3]}, {"x": [4, 5, 6]}]) == {"/x": [[1, 2, 3], [4, 5, 6]]}
    assert differences([a, a, a]) == {}


def test_axisymmetric_figures_have_r_and_z_and_units(client: sg.Client) -> None:
    problem = sg.examples.annular_punch(refine=0)
    problem.units = p.Units(length="mm", force="N", stress="MPa")
    (drawn,) = problem.plot().axes
    assert (drawn.get_xlabel(), drawn.get_ylabel()) == ("$r$  (mm)", "$z$  (mm)")
    assert "prescribed $u_r$" in words(drawn.figure)
    fields = client.submit(problem).wait(60, progress=False).fields()
    axes = fields.plot(quantity="stress_zz").axes
    assert (
        axes[0].get_xlabel().startswith("$r$  (mm)")
        and axes[-1].get_ylabel() == r"hoop stress  $\sigma_{\theta\theta}$  (MPa)"
    )


def test_axes_of_a_study_have_units_and_the_scale_of_their_values(client: sg.Client) -> None:
    base = sg.examples.rectangular_punch(refine=0)
    base.units = p.Units(length="mm", force="N", stress="MPa")
    place = "contacts.0.indentation"
    even = client.sweep(base, {place: [0.05, 0.1, 0.15, 0.2, 0.25, 0.3]}).wait(60, progress=False)
    (axes,) = even.plot("normal_force").axes
    assert (axes.get_xscale(), axes.get_xlabel(), axes.get_ylabel()) == (
        "linear",
        "indentation  (mm)",
        "normal force  (N/mm)",
    )
    growing = client.sweep(base, {"materials.0.youngs_modulus": sg.logspace(10, 1000, 3)}).wait(60, progress=False)
    (axes,) = growing.plot("peak_tangential_stress", xlim=(5, 2000)).axes
    assert (axes.get_xscale(), axes.get_xlabel()) == ("log", "$E$  (MPa)") and axes.get_xlim() == (5, 2000)
    assert axes.get_ylabel().endswith("(MPa)")
    mu = client.sweep(base, {"contacts.0.friction.coefficient": [0.1, 0.2], place: [0.1, 0.2, 0.4]}).wait(
        60, progress=False
    )
    labels = mu.plot("normal_force", x="coefficient").axes[0].get_legend_handles_labels()[1]
    assert labels[:3] == ["indentation = 0.1 mm", "indentation = 0.2 mm", "indentation = 0.4 mm"]


def test_a_long_history_is_no_longer_than_can_be_seen(punch: sg.Result) -> None:
    rows = 20_000
    entered = np.zeros(rows, int)
    entered[777] = 55
    long: dict[str, Any] = {name: np.resize(column, rows) for name, column in punch.history.columns().items()}
    long |= {"k": np.arange(rows), "step": np.zeros(rows, int), "contact_entered": entered}
    history = dataclasses.replace(punch.history, **long)
    figure = history.plot()
    bars: list[Any] = list(figure.axes[1].patches)
    assert len(bars) <= 2 * figures.BARS and max(bar.get_height() for bar in bars) == 55, "no peak is lost"
    out = io.BytesIO()
    figure.savefig(out, format="svg")
    assert len(out.getvalue()) < 2_500_000


def test_looks_of_curves_differ_without_colours() -> None:
    assert len({str(look) for look in CURVES}) == MOST_CURVES == len(CURVES)


def test_the_service_draws_with_the_same_options(punch: sg.Result, tmp_path: pathlib.Path) -> None:
    full, bare = (punch.job.svg("profile", style=style) for style in ("full", "bare"))
    assert "verdict" in full and "verdict" not in bare
    path = punch.job.save_figure(
        tmp_path / "a.svg", "profile", size="slide", xlim=(0.3, 0.45), ylim=[-300, 0], ylim_below=(0, 50.5)
    )
    assert path.read_text(encoding="utf-8").startswith('<svg width="864" height="486"')
    assert "σ" in punch.job.svg("deformed", stress="yy")
    with pytest.raises(sg.SignoriniError, match="xlim: expected two finite numbers, .*; ylim: expected two finite"):
        punch.job.svg("profile", xlim=(2, 1), ylim=(math.nan, 1))
    with pytest.raises(TypeError, match="no such option: zlim; there are style, stress, xlim, ylim, ylim_below"):
        punch.job.svg("profile", zlim=(0, 1))  # type: ignore[call-arg]
