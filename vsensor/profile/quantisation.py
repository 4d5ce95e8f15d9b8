"""What rounding on the bus adds to the lines."""

from collections.abc import Sequence

from vsensor.profile.compiled import Profile
from vsensor.profile.quantities import LINES


def quantisation_error_m(
    profile: Profile, ranges_m: Sequence[float] = (20.0, 50.0, 80.0, 100.0)
) -> dict[float, float]:
    """Return the worst lateral error that rounding on the bus adds at each range, over all lines.

    Half a step of each coefficient's signal times x^n / n! (or x^n where c2, c3 are sent), added up.
    """
    powers = {
        "offset_m": (0, 1),
        "heading": (1, 1),
        "c2_per_m": (2, 1),
        "curvature_per_m": (2, 2),
        "c3_per_m2": (3, 1),
        "curvature_rate_per_m2": (3, 6),
    }
    worst = dict.fromkeys(ranges_m, 0.0)
    for side in LINES:
        steps = [
            (abs(binding.signal.scale / binding.gain) / 2, *powers[name])
            for plan in profile.messages
            for binding in plan.bindings
            for line, _, name in [binding.quantity.partition(".")]
            if line == side and name in powers and not binding.signal.is_float
        ]
        for x in worst:
            worst[x] = max(worst[x], sum(half * x**power / divisor for half, power, divisor in steps))
    return worst
