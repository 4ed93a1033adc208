"""Names in order, with those of members made on demand: like the list of all of them, but without it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circuitkit.circuit.names import Names, node_of

letters = st.lists(st.text("abc", min_size=1, max_size=3), max_size=4, unique=True)


@st.composite
def names(draw: st.DrawFn) -> tuple[Names, list[str]]:
    """Names, and the same as a list."""
    before, after = [f"x{name}" for name in draw(letters)], [f"z{name}" for name in draw(letters)]
    populations = [(f"y{name}", draw(st.integers(1, 5))) for name in draw(letters)]
    members = [f"{name}[{member}]" for name, size in populations for member in range(size)]
    return Names(before, populations, after), [*before, *members, *after]


@given(names(), st.slices(8))
def test_they_are_a_sequence(pair, part):
    found, expected = pair
    assert list(found) == expected
    assert found == expected
    assert found == tuple(expected)
    assert len(found) == len(expected)
    assert [found[i] for i in range(-len(expected), len(expected))] == expected * 2
    assert list(found[part]) == expected[part]
    assert [found.index(name) for name in expected] == list(range(len(expected)))
    assert all(name in found for name in expected)
    assert hash(found) == hash(Names(*_parts(found)))


def _parts(found: Names) -> tuple[list[str], list[tuple[str, int]], list[str]]:
    singles = [name for name in found if "[" not in name]
    sizes: dict[str, int] = {}
    for name in found:
        if "[" in name:
            sizes[name.partition("[")[0]] = sizes.get(name.partition("[")[0], 0) + 1
    before = [name for name in singles if name.startswith("x")]
    return before, list(sizes.items()), [name for name in singles if name.startswith("z")]


@pytest.mark.parametrize(
    "name", ["ring", "ring[]", "ring[5]", "ring[05]", "ring[-1]", "ring[1", "rin[1]", "", "[1]", 3]
)
def test_what_is_no_name_is_not_among_them(name):
    found = Names(["a"], [("ring", 5)])
    assert name not in found
    with pytest.raises((IndexError, ValueError)):
        found.index(name) if isinstance(name, str) else found[99]


@pytest.mark.parametrize(
    ("name", "node"), [("ring[3]", "ring"), ("left.ring[0]", "left.ring"), ("q1", "q1"), ("", "")]
)
def test_the_node_of_a_member_is_its_population(name, node):
    assert node_of(name) == node


def test_a_large_population_takes_no_memory():
    found = Names([], [("ring", 2**31 - 1)])
    assert found[2**31 - 2] == "ring[2147483646]"
    assert found.index("ring[2147483646]") == 2**31 - 2
    assert found == Names([], [("ring", 2**31 - 1)])
    assert found != Names([], [("ring", 2**31 - 2)])
    assert repr(found).endswith(", ring[19], …)")
