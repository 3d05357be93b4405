"""What a run needs of the memory, and the refusal of what does not fit."""

import pytest

from tests.cases import data
from triboflux import memory
from triboflux.case import Case
from triboflux.errors import InputError


def test_memory_grows_with_points_dimensions_and_outputs():
    def estimate(points, outputs=1):
        return memory.memory_estimate(
            Case(**data(grid__points=points, initial__charge=[], run__outputs=outputs))
        )

    assert estimate([64]) == 8 * 64 * (210 + 2 * 3 * 8)
    assert estimate([16, 4]) == 8 * 64 * (240 + 2 * 3 * 11)
    assert estimate([4, 4, 4]) == 8 * 64 * (270 + 2 * 3 * 14)
    assert estimate([64], [0.0, 0.5, 1.0]) == 8 * 64 * (210 + 2 * 4 * 8)


def test_outputs_that_stream_to_a_file_need_no_memory(monkeypatch):
    def case(outputs):
        return Case(**data(grid__points=[64], initial__charge=[], run__outputs=outputs))

    assert memory.memory_estimate(case(2), streamed=True) == memory.memory_estimate(case(2))
    streamed = memory.memory_estimate(case(100_000), streamed=True)
    assert streamed == memory.memory_estimate(case(2))
    monkeypatch.setattr(memory, "available_memory", lambda: streamed)
    memory.require_memory(case(100_000), streamed=True)
    with pytest.raises(InputError, match="with 100000 outputs needs about"):
        memory.require_memory(case(100_000))
    monkeypatch.setattr(memory, "available_memory", lambda: streamed - 1)
    with pytest.raises(InputError, match=r"^grid.points is \[64\], which needs about "):
        memory.require_memory(case(100_000), streamed=True)


def test_a_grid_that_cannot_fit_is_refused(monkeypatch):
    case = Case(**data(grid__points=[4096] * 3, initial__charge=[]))
    monkeypatch.setattr(memory, "available_memory", lambda: 16 * 2**30)
    with pytest.raises(InputError, match=r"^grid.points is \[4096, 4096, 4096\], which with 20 "):
        memory.require_memory(case)
    monkeypatch.setattr(memory, "available_memory", lambda: None)
    memory.require_memory(case)


def test_this_machine_has_memory():
    available = memory.available_memory()
    assert available is None or available > 2**20
