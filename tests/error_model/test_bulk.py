import numpy as np
import pytest

from tests.error_model.models import SPEED_MPS, errors, flat_model, law_of, many_lines, once
from vsensor.draws import Draws, Stage
from vsensor.error_model.bulk import applied_errors, grid_size
from vsensor.lanefit import LaneFitConfig, fit, operator

X_M = np.arange(5.0, 101.0, 0.5)


def test_errors_in_bulk_are_those_of_the_sensor():
    model, count = flat_model(), 50
    draws = Draws(3)
    white = np.array(
        [draws.at(Stage.ERROR_MODEL, 0, line).standard_normal(grid_size(model)) for line in range(count)]
    )
    found = errors(once(law_of(model), many_lines(count, X_M), seed=3))
    np.testing.assert_allclose(applied_errors(model, X_M, SPEED_MPS, white), found, atol=1e-12)


@pytest.mark.parametrize("weighting", ["uniform", "range"])
@pytest.mark.parametrize("order", [2, 3, 5])
def test_the_operator_gives_the_coefficients_of_the_fit(order, weighting):
    config = LaneFitConfig(order=order, weighting=weighting)
    y = 1.75 + 1e-3 * X_M + 0.05 * np.sin(X_M / 15.0)
    direct = fit(config, X_M, y, np.zeros(len(X_M))).coefficients
    scale = X_M.max() ** np.arange(order + 1)
    np.testing.assert_allclose((operator(config, X_M) @ y) * scale, direct * scale, atol=1e-9)


@pytest.mark.parametrize(("end_m", "least"), [(100.0, 0.756), (120.0, 0.715)])
def test_a_cubic_keeps_a_squared_exponentials_std_within_3_percent_and_an_exponentials_not(end_m, least):
    """The std after the fit over that before at every range, in closed form; least: where it loses most."""
    x = np.arange(0.0, end_m + 1.0)
    hat = np.vander(x, 4, increasing=True) @ operator(LaneFitConfig(), x)
    distance = np.abs(x[:, None] - x[None, :])

    def kept(correlation):
        return np.sqrt(np.einsum("ij,jk,ik->i", hat, correlation, hat))

    np.testing.assert_allclose(kept(np.exp(-0.5 * (distance / 50.0) ** 2)), 1.0, atol=0.03)
    rough = kept(np.exp(-distance / 20.0))
    assert rough.min() == pytest.approx(least, abs=0.005)
    assert rough.max() > 1.1
