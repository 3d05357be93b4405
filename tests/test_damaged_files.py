"""Damaged files, given to the commands that read them: one sentence, and nothing else."""

import random
from collections import Counter

import pytest

from tests.damaged_files import KINDS, Damage
from triboflux import segments


@pytest.fixture(scope="module")
def damage(tmp_path_factory):
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(segments, "STEPS_SMALL", 2)
        yield Damage(tmp_path_factory.mktemp("files"))


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_file_is_refused_or_makes_no_difference(damage, kind):
    seed = random.randrange(2**32)
    print("seed", seed)
    chance = random.Random(seed)
    found = Counter(damage.check(kind, chance) for _ in range(4 if kind == "theirs" else 8))
    # most damage has to be noticed, or the test does none
    assert found[True] >= 1, seed
