"""All parameters at once: which share of the offset's variance each one has, alone and with others.

Sobol's indices by Saltelli's design. First order: the share that knowing the parameter would take away;
total: what would be left if all others were known; a pair's joint effect: what the two have together beyond
their own.
The offsets of many lines are one output each; their indices are put together weighted by variance.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.stats import qmc, sobol_indices

from vsensor.types import Array

DRAWS = 512
SCRAMBLES = 8
Z_95 = 1.96


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shares:
    """Indices as (value, half of its 95 % interval), and how much the outputs vary.

    `std` is the root of the outputs' mean variance, `abs_95` the 95 % quantile of their size.
    """

    first: Mapping[str, tuple[float, float]]
    total: Mapping[str, tuple[float, float]]
    joint: Mapping[tuple[str, str], tuple[float, float]]
    std: float
    abs_95: float


def shares(
    outputs: Callable[[Array], Array], halves: Mapping[str, float], *, draws: int = DRAWS, seed: int = 0
) -> Shares:
    """Return the shares of parameters that are anywhere within +- `halves`, all places alike.

    `outputs` maps changes (P, D) to values (P, S) that are 0 without a change. `draws`: a power of two.
    """
    names, width = list(halves), np.array(list(halves.values()))
    pairs = list(combinations(range(len(names)), 2))
    found, spread, sizes = [], [], []
    for scramble in range(SCRAMBLES):
        unit = qmc.Sobol(2 * len(names), seed=np.random.default_rng((seed, scramble))).random(draws)
        a, b = np.split(np.tile(width, 2) * (2.0 * unit - 1.0), 2, axis=1)
        f_a, f_b = outputs(a).T, outputs(b).T
        f_ab = np.stack([outputs(_mixed(a, b, (k,))).T for k in range(len(names))])
        index = sobol_indices(func={"f_A": f_a, "f_B": f_b, "f_AB": f_ab}, n=draws)
        variance = np.var(np.hstack([f_a, f_b]), axis=1)
        weight = variance / max(float(variance.sum()), 1e-300)
        shape = len(weight), len(names)  # scipy leaves out the first of a single output
        first = weight @ np.reshape(index.first_order, shape)
        total = weight @ np.reshape(index.total_order, shape)
        both = np.array(
            [weight @ _closed(f_a, f_b, outputs(_mixed(a, b, pair)).T, variance) for pair in pairs]
        )
        joint = both - np.array([first[i] + first[j] for i, j in pairs])
        found.append(np.concatenate([first, total, joint]))
        spread.append(float(variance.mean()))
        sizes.append(np.quantile(np.abs(np.hstack([f_a, f_b])), 0.95))
    mean, half = np.mean(found, axis=0), Z_95 * np.std(found, axis=0, ddof=1) / np.sqrt(SCRAMBLES)
    values = list(zip(mean.tolist(), half.tolist(), strict=True))
    count = len(names)
    return Shares(
        first=dict(zip(names, values[:count], strict=True)),
        total=dict(zip(names, values[count : 2 * count], strict=True)),
        joint={(names[i], names[j]): value for (i, j), value in zip(pairs, values[2 * count :], strict=True)},
        std=float(np.sqrt(np.mean(spread))),
        abs_95=float(np.mean(sizes)),
    )


def _mixed(a: Array, b: Array, columns: tuple[int, ...]) -> Array:
    """Return `a` with some columns of `b`."""
    mixed = a.copy()
    mixed[:, columns] = b[:, columns]
    return mixed


def _closed(f_a: Array, f_b: Array, f_mixed: Array, variance: Array) -> Array:
    """Return the share (S,) that the mixed columns have, each alone and together."""
    centred = f_b - f_b.mean(axis=1, keepdims=True)
    return np.asarray(np.mean(centred * (f_mixed - f_a), axis=1) / np.maximum(variance, 1e-300))
