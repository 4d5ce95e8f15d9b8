"""Lens distortion: the formula, the range in which it can be inverted, and the inverse."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsensor import distortion
from vsensor.distortion import Distortion, DistortionConfig, distort, jacobian, monotone_radius, undistort
from vsensor.errors import ConfigError
from vsensor.schema import convert

ASIDE = {"k1": 0.815, "k2": -0.1002, "k3": 0.0071, "p1": 0.3954, "p2": 0.29655}
"""The radial derivative touches 6 |p| r from above, so that the determinant is first 0 between the axes."""

LENSES = {
    "strong barrel": {"k1": -0.4},
    "barrel that straightens out": {"k1": -0.4, "k2": 0.2, "p1": 0.001, "p2": -0.002},
    "pincushion": {"k1": 0.5, "k2": 1.0, "k3": 3.0},
    "calibrated, with all five": {"k1": -0.3, "k2": 0.12, "k3": -0.02, "p1": 1e-3, "p2": -5e-4},
    "folds early": {"k1": -5.0},
    "nearly folds and then widens": {"k1": -1.0, "k2": 0.4501},
    "tangential alone": {"p1": 0.1, "p2": 0.2},
    "barrel and strongly tilted": {"k1": -0.4, "p1": 0.05, "p2": 0.03},
    "ends beside the axis of its tangential part": ASIDE,
    "largest numbers": {"k1": 5.0, "k2": -50.0, "k3": 500.0, "p1": 0.5, "p2": -0.5},
}
EACH_LENS = pytest.mark.parametrize("numbers", LENSES.values(), ids=list(LENSES))
FOCAL_PX = 1312.0
RESIDUAL_PX = 1e-9
IMAGE_RADIUS = 2.0  # 63 degrees off axis: no lane camera sees further


def lens_of(numbers):
    lens = Distortion.of(DistortionConfig(**numbers))
    assert lens is not None
    return lens


def in_range(lens, count=20_000, seed=1):
    """Return points all over the monotone range, a tenth of them within 1e-2 to 1e-12 of its end."""
    rng = np.random.default_rng(seed)
    part = np.sqrt(rng.random(count))
    part[: count // 10] = 1.0 - 10.0 ** rng.uniform(-12, -2, count // 10)
    angle = rng.uniform(-np.pi, np.pi, count)
    radius = min(lens.radius, IMAGE_RADIUS) * part
    return radius * np.cos(angle), radius * np.sin(angle)


def least_determinant(numbers, radius):
    """Return the least determinant of the Jacobian around circles of each radius (N,)."""
    angle = np.linspace(-np.pi, np.pi, 7201)
    found = []
    for r in radius:
        xx, xy, yy = jacobian(lens_of(numbers), r * np.cos(angle), r * np.sin(angle))
        found.append((xx * yy - xy * xy).min())
    return np.array(found)


# The formula


def test_a_point_lies_where_the_paper_puts_it():
    k1, k2, k3, p1, p2 = -0.3, 0.12, -0.02, 1e-3, -5e-4
    x, y = 0.3, -0.2
    r2 = 0.13
    gain = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    expected = (
        x * gain + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * gain + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )
    lens = lens_of({"k1": k1, "k2": k2, "k3": k3, "p1": p1, "p2": p2})
    np.testing.assert_allclose(
        distort(lens, np.array([x]), np.array([y])), np.array([expected]).T, rtol=1e-15
    )


@EACH_LENS
def test_the_jacobian_is_the_derivative(numbers):
    lens = lens_of(numbers)
    x, y = in_range(lens, 300)
    along_x = distortion._distorted(lens, x + 1e-40j, y)  # a complex step has no rounding to speak of
    along_y = distortion._distorted(lens, x, y + 1e-40j)
    expected = [along_x[0].imag, along_x[1].imag, along_y[1].imag]
    np.testing.assert_allclose(jacobian(lens, x, y), np.array(expected) / 1e-40, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(along_x[1].imag, along_y[0].imag, rtol=1e-12, atol=1e-53)  # symmetric


def test_no_distortion_is_no_lens():
    assert Distortion.of(DistortionConfig()) is None


@EACH_LENS
def test_opencv_draws_the_same_pixels(numbers):
    cv2 = pytest.importorskip("cv2")
    lens = lens_of(numbers)
    x, y = in_range(lens, 500)
    five = [numbers.get(name, 0.0) for name in ("k1", "k2", "p1", "p2", "k3")]
    points = np.column_stack([x, y, np.ones(len(x))])
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array(five))
    found = np.column_stack(distort(lens, x, y))
    np.testing.assert_allclose(found, pixels[:, 0], rtol=1e-13, atol=1e-13)


def test_opencv_inverts_to_the_same_points():
    cv2 = pytest.importorskip("cv2")
    numbers = LENSES["calibrated, with all five"]
    lens = lens_of(numbers)
    x, y = (0.4 * coordinate / lens.radius for coordinate in in_range(lens, 500))
    x_seen, y_seen = distort(lens, x, y)
    five = np.array([numbers[name] for name in ("k1", "k2", "p1", "p2", "k3")])
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-15)
    seen = np.column_stack([x_seen, y_seen])[:, None]
    expected = cv2.undistortPoints(seen, np.eye(3), five, criteria=stop)[:, 0]
    np.testing.assert_allclose(np.column_stack(undistort(lens, x_seen, y_seen)), expected, atol=1e-10)


# The range


@pytest.mark.parametrize(
    ("numbers", "radius"),
    [
        ({"k1": -0.4}, (1 / 1.2) ** 0.5),  # 1 + 3 k1 r^2 = 0
        ({"k2": -0.2}, 1.0),  # 1 + 5 k2 r^4 = 0
        ({"k3": -1 / 7}, 1.0),
        ({"k1": -1.0, "k2": 0.4}, 0.5**0.5),  # 1 - 3 s + 2 s^2 = (1 - s)(1 - 2 s)
        ({"k1": 0.5, "k2": 1.0}, np.inf),
        ({"p1": 0.3, "p2": -0.4}, 1 / 3),  # 1 = 6 |p| r
        ({"k1": -1.0, "k2": 0.46}, np.inf),  # 9 < 20 k2: the derivative has no root
    ],
)
def test_the_range_ends_where_the_closed_form_says(numbers, radius):
    assert monotone_radius(DistortionConfig(**numbers)) == pytest.approx(radius, rel=1e-9)


@EACH_LENS
def test_a_scan_finds_the_jacobian_positive_definite_up_to_the_end_of_the_range_and_not_beyond(numbers):
    radius = monotone_radius(DistortionConfig(**numbers))
    assert (least_determinant(numbers, np.linspace(0, min(radius, 3.0) * (1 - 1e-5), 200)) > 0).all()
    if radius < np.inf:
        assert least_determinant(numbers, [radius * (1 + 1e-4)])[0] < 0


def test_the_range_can_end_beside_the_axis_of_the_tangential_part():
    radius = monotone_radius(DistortionConfig(**ASIDE))
    angle = np.linspace(-np.pi, np.pi, 72001)
    xx, xy, yy = jacobian(lens_of(ASIDE), radius * np.cos(angle), radius * np.sin(angle))
    determinant = xx * yy - xy * xy
    assert abs(determinant.min()) < 1e-6
    from_axis = angle[determinant.argmin()] - np.arctan2(ASIDE["p1"], ASIDE["p2"])
    assert np.cos(from_axis) > -0.99  # on the axis it is still positive


def number(limit):
    return st.floats(-limit, limit, allow_nan=False, allow_subnormal=False)


@settings(max_examples=60, deadline=None)
@given(number(5.0), number(50.0), number(500.0), number(0.5), number(0.5))
def test_whatever_the_numbers_the_range_is_where_the_determinant_is_positive(k1, k2, k3, p1, p2):
    numbers = {"k1": k1, "k2": k2, "k3": k3, "p1": p1, "p2": p2}
    radius = monotone_radius(DistortionConfig(**numbers))
    if any(numbers.values()):
        assert (least_determinant(numbers, np.linspace(0, min(radius, 3.0) * (1 - 1e-4), 40)) > 0).all()


@EACH_LENS
def test_outside_the_range_nothing_appears(numbers):
    lens = lens_of(numbers)
    if lens.radius < np.inf:
        x, y = in_range(lens, 500)
        scale = 1.0001 * lens.radius / np.hypot(x, y)
        assert np.isnan(distort(lens, x * scale, y * scale)).all()


# The inverse


@EACH_LENS
def test_distorted_again_the_inverse_gives_the_pixel_back_everywhere_in_the_range(numbers):
    lens = lens_of(numbers)
    x_seen, y_seen = distort(lens, *in_range(lens))
    again = distort(lens, *undistort(lens, x_seen, y_seen))
    residual_px = FOCAL_PX * np.hypot(again[0] - x_seen, again[1] - y_seen)
    size = np.maximum(np.hypot(x_seen, y_seen), 1.0)  # the largest numbers fill an image 1e4 wide
    assert (residual_px / size < RESIDUAL_PX).all()


@settings(max_examples=60, deadline=None)
@given(number(5.0), number(50.0), number(500.0), number(0.5), number(0.5))
def test_whatever_the_numbers_the_inverse_leads_back_to_the_point(k1, k2, k3, p1, p2):
    lens = Distortion.of(DistortionConfig(k1=k1, k2=k2, k3=k3, p1=p1, p2=p2))
    if lens is None:
        return
    x, y = in_range(lens, 200)
    xx, xy, yy = jacobian(lens, x, y)
    steepness = (np.abs(xx) + np.abs(yy) + 2 * np.abs(xy)) / (xx * yy - xy * xy)  # bounds 1 / eigenvalue
    terms = 1.0 + 16 * (5 + 4 * 50 + 16 * 500)
    found = undistort(lens, *distort(lens, x, y))
    assert (np.hypot(found[0] - x, found[1] - y) <= 1e-15 * terms * steepness + 1e-14).all()


@EACH_LENS
def test_the_inverse_agrees_with_one_to_40_digits(numbers):
    lens = lens_of(numbers)
    x, y = (0.9 * coordinate for coordinate in in_range(lens, 6, seed=3))
    x_seen, y_seen = distort(lens, x, y)
    found = np.column_stack(undistort(lens, x_seen, y_seen))
    k1, k2, k3, p1, p2 = (mpmath.mpf(numbers.get(name, 0.0)) for name in ("k1", "k2", "k3", "p1", "p2"))

    def missing(a, b, to):
        r2 = a * a + b * b
        gain = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        return (
            a * gain + 2 * p1 * a * b + p2 * (r2 + 2 * a * a) - mpmath.mpf(to[0]),
            b * gain + 2 * p2 * a * b + p1 * (r2 + 2 * b * b) - mpmath.mpf(to[1]),
        )

    with mpmath.workdps(40):
        for start, to, answer in zip(
            zip(x, y, strict=True), zip(x_seen, y_seen, strict=True), found, strict=True
        ):
            exact = mpmath.findroot(lambda a, b, to=to: missing(a, b, to), start)
            np.testing.assert_allclose(answer, [float(exact[0]), float(exact[1])], rtol=0, atol=1e-13)


@EACH_LENS
def test_an_image_point_that_nothing_in_the_range_shows_is_refused(numbers):
    lens = lens_of(numbers)
    if lens.radius == np.inf:
        return
    angle = np.linspace(-np.pi, np.pi, 90)
    edge = distort(lens, lens.radius * 0.9999999 * np.cos(angle), lens.radius * 0.9999999 * np.sin(angle))
    farthest = np.hypot(*edge).max()
    for factor in (1.001, 1.5, 10.0, 1e6, 1e30):
        beyond = farthest * factor * np.cos(angle), farthest * factor * np.sin(angle)
        assert np.isnan(undistort(lens, *beyond)).all()


def test_an_image_that_does_not_end_is_inverted_far_out_too():
    lens = lens_of({"k1": 0.5})
    radius = np.array([5.0, 30.0, 500.0])
    found = undistort(lens, *distort(lens, radius, -radius))
    np.testing.assert_allclose(found, [radius, -radius], rtol=1e-14)


@EACH_LENS
def test_the_middle_stays_in_the_middle(numbers):
    zero = np.zeros(1)
    assert np.array_equal(distort(lens_of(numbers), zero, zero), [[0.0], [0.0]])
    assert np.array_equal(undistort(lens_of(numbers), zero, zero), [[0.0], [0.0]])


def test_what_is_not_a_number_stays_so_and_no_points_are_no_points():
    lens = lens_of({"k1": -0.4, "p1": 0.01})
    assert np.isnan(undistort(lens, np.array([np.nan]), np.array([0.0]))).all()
    assert np.isnan(distort(lens, np.array([0.0]), np.array([np.nan]))).all()
    assert len(undistort(lens, np.zeros(0), np.zeros(0))[0]) == 0


@pytest.mark.parametrize(
    ("table", "expected"),
    [({"k1": 7}, "k1 = 7"), ({"k4": 0.1}, "k4: unknown key"), ({"p1": float("inf")}, "p1 = inf")],
)
def test_a_wrong_number_is_refused_by_name(table, expected):
    with pytest.raises(ConfigError, match=expected):
        convert(table, DistortionConfig, "lens.toml")
