import numpy as np
import pytest

from gimbalcal.report import figures, parameter_figures, style

RNG = np.random.default_rng(7)


def test_residuals_have_units_on_every_row_and_circle_what_is_far() -> None:
    after = RNG.normal(size=(18, 3))
    after[4, 1] = 20.0
    names = [str(i) for i in range(1, 19)]
    figure = figures.residuals_by_position(names, 100 * after, after, np.ones((18, 3)), "xyz", "µg")
    left = figure.axes[::2]
    assert [ax.get_ylabel() for ax in left] == ["x  [µg]", "y  [µg]", "z  [µg]"]
    circled = [line.get_xdata().tolist() for line in figure.axes[3].lines if line.get_markerfacecolor() == "none"]
    assert circled == [[4]]


def test_titles_give_the_rms() -> None:
    before, after = np.full((6, 1), 280.0), np.array([[3.0], [-3.0]] * 3)
    figure = figures.residuals_by_position(list("123456"), before, after, None, ["|f| − g"], "µg")
    assert "280 µg rms" in figure.axes[0].get_title(loc="left")
    assert "3.00 µg rms" in figure.axes[1].get_title(loc="left")


def test_equal_arrays_give_equal_bytes() -> None:
    matrix = np.eye(3) + 0.4 * (1 - np.eye(3))
    first, second = (style.svg(parameter_figures.correlation("abc", matrix)) for _ in range(2))
    assert first == second
    assert first.startswith(b"<?xml")


def test_correlation_writes_strong_values_into_their_cells() -> None:
    matrix = np.array([[1.0, -0.72, 0.1], [-0.72, 1.0, 0.0], [0.1, 0.0, 1.0]])
    texts = [t.get_text() for t in parameter_figures.correlation("abc", matrix).axes[0].texts]
    assert texts == ["−.7", "−.7"]


def test_stages_may_leave_a_parameter_out() -> None:
    ratio = np.array([[0.1, np.nan], [0.01, 0.5]])
    figure = parameter_figures.sigma_by_stage(["bias x", "K x"], ["coarse", "joint"], ratio)
    assert figure.axes[0].get_xscale() == "log"
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["coarse", "joint"]


@pytest.mark.parametrize("count", [1, 33, 120])
def test_stages_with_long_names_fit_whatever_the_number_of_parameters(count: int) -> None:
    stages = [
        " + ".join(["gyro scale factor", "gyro misalignment", "gyro scale nonlinearity"][: k + 1]) for k in range(3)
    ]
    labels = [f"gyro g sensitivity rate {i}" for i in range(count)]
    figure = parameter_figures.sigma_by_stage(labels, stages, np.full((3, count), 0.1))
    style.svg(figure)  # lays it out; a figure that is too small is a warning, and so an error
    (width, height), (ax,) = figure.get_size_inches(), figure.axes
    axes, legend = ax.get_position(), figure.legends[0].get_window_extent()
    assert axes.width > 0.5
    assert axes.height * height / count > 0.12  # inches a row: letters of 8 points are 0.11 high
    assert legend.x0 >= 0
    assert legend.x1 <= width * figure.dpi
    assert legend.y0 > axes.y1 * height * figure.dpi


def test_letters_of_many_correlations_fit_their_rows() -> None:
    for count in (3, 30, 90):
        figure = parameter_figures.correlation([f"bias {i}" for i in range(count)], np.eye(count))
        style.svg(figure)
        ax = figure.axes[0]
        row = ax.get_window_extent().height / figure.dpi * 72 / count
        assert ax.get_yticklabels()[0].get_fontsize() < row


def test_what_is_left_over_time_is_measured_minus_fitted() -> None:
    t = np.linspace(0, 24, 50)
    curve = figures.Curve("roll", "arcsec", np.sin(t) + 2.0, np.sin(t), 0.5)
    figure = figures.over_time(t, [curve])
    rest = figure.axes[1].lines[0].get_ydata()
    assert rest == pytest.approx(np.full(50, 2.0), abs=1e-12)  # rounding of a sum of two doubles
    assert "2.00 arcsec" in figure.axes[1].get_title(loc="left")


def test_positions_on_the_equator_are_drawn_once() -> None:
    gravity = np.array([[0, 0, 1.0], [1.0, 0, 0], [0, 0, -1.0], [1.0, 0, -1e-9]])
    figure = figures.schedule(["1", "2", "3", "4"], np.zeros((4, 2)), ("inner", "outer"), gravity)
    up, down = figure.axes[1], figure.axes[2]
    assert [t.get_text() for t in up.texts] == ["1", "2,4"]
    assert [t.get_text() for t in down.texts] == ["3"]
