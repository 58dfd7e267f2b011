"""Trajectories kept as a tree against trajectories kept whole."""

import numpy as np
import pytest
from gridwright_server.slam.resampling import low_variance_ancestors, normalised
from gridwright_server.slam.trajectory import COLLAPSE_EVERY, Ancestry
from naive.full_history import FullHistory


def grow(rng, particles, updates, resample_probability, spread=2.0):
    """Yields (ancestry, naive history) after every update of a filter that only resamples."""
    ancestry, history = Ancestry(), FullHistory(particles)
    parents = np.arange(particles)
    for _ in range(updates):
        poses = rng.normal(size=(particles, 3))
        ancestry.append(poses.copy(), parents)
        history.append(poses, parents)
        parents = np.arange(particles)
        if rng.random() < resample_probability:
            weights = normalised(rng.normal(scale=spread, size=particles))
            parents = low_variance_ancestors(weights, rng.random())
        yield ancestry, history


@pytest.mark.parametrize("particles", [1, 2, 9])
@pytest.mark.parametrize("resample_probability", [0.0, 0.05, 0.5, 1.0])
def test_no_path_is_changed_by_collapsing(particles, resample_probability):
    rng = np.random.default_rng([particles, int(100 * resample_probability)])
    growing = grow(rng, particles, 5 * COLLAPSE_EVERY + 7, resample_probability)
    for updates, (ancestry, history) in enumerate(growing, start=1):
        assert len(ancestry) == updates
        if updates % 13 == 0 or updates % COLLAPSE_EVERY < 3:
            for particle in range(particles):
                np.testing.assert_array_equal(ancestry.path(particle), history.paths[particle])


def test_what_all_share_is_kept_once():
    rng = np.random.default_rng(4)
    most_open = 0
    for ancestry, _ in grow(rng, 10, 20 * COLLAPSE_EVERY, 0.3):
        most_open = max(most_open, len(ancestry._open))
    # Ten particles have one ancestor a few resamplings back: little stays open over a collapse.
    assert most_open <= 2 * COLLAPSE_EVERY
    assert len(ancestry._settled) >= 18 * COLLAPSE_EVERY


def test_nothing_is_given_up_while_lines_differ():
    *_, (ancestry, _) = grow(np.random.default_rng(5), 3, 3 * COLLAPSE_EVERY, 0.0)
    assert not ancestry._settled


def test_no_updates_make_an_empty_path():
    assert Ancestry().path(0).shape == (0, 3)
