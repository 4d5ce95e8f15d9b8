"""Markov chains of few states."""

import numpy as np

from vsensor.error_model.chain import below, once, stepped


def test_one_step_of_a_chain_is_the_step_of_many_for_each_state_and_number():
    random = np.random.default_rng(3)
    step = random.dirichlet(np.ones(5), 5)
    step[2] = [0.0, 0.0, 1.0, 0.0, 0.0]
    uniform = np.concatenate([[0.0, 1.0 - 1e-16], step.cumsum(axis=1).ravel(), random.random(200)])
    for state in range(5):
        many = stepped(step, np.full(len(uniform), state), 1, uniform)
        assert [once(below(step), state, one) for one in uniform.tolist()] == many.tolist()
