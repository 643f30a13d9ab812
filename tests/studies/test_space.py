"""Values are drawn where they have an effect, and nowhere else."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import shown_keys, with_values
from tracker.studies import space
from tracker.studies.space import Varied

BASE = RunParameters(single_view="none")


@given(st.data())
def test_a_parameter_counts_only_with_its_method_and_conditions(data: st.DataObject) -> None:
    keys = data.draw(st.lists(st.sampled_from([*METHODS, *PARAMETERS]), min_size=1, unique=True))
    varied = [space.around(key, _default(key)) for key in keys if _can_vary(key)]

    def draw(one: Varied) -> object:
        if one.choices:
            return data.draw(st.sampled_from(one.choices))
        return one.low

    values = space.drawn(varied, [BASE], draw)
    shown = set(shown_keys(with_values(BASE, values)))
    assert set(values) == {one.key for one in varied} & shown


def _default(key: str) -> object:
    return PARAMETERS[key].default if key in PARAMETERS else None


def _can_vary(key: str) -> bool:
    return key not in METHODS or key == "fusion_method"


def test_a_range_around_a_value_holds_it_and_stays_within_the_definition() -> None:
    faults = []
    for p in PARAMETERS.values():
        for now in (p.default, p.minimum, p.maximum) if p.kind in ("float", "int") else ():
            one = space.around(p.key, now, p.default)
            within = p.minimum <= one.low < one.high <= p.maximum
            if not (within and one.nearest(now) == now and one.nearest(p.default) == p.default):
                faults.append(f"{p.key}: {one.low} … {one.high} around {now}")
            elif one.log and one.low <= 0.0:
                faults.append(f"{p.key}: {one.low} has no logarithm")
    assert not faults


def test_a_grid_has_every_combination_once() -> None:
    varied = (
        Varied("fusion_method", choices=("multi_bernoulli", "sequential_phd")),
        Varied("fusion.clutter_rate", 1.0, 9.0, log=True, steps=3),
    )
    found = list(space.grid(varied, [BASE]))
    rates = sorted({one["fusion.clutter_rate"] for one in found})
    assert rates == pytest.approx([1.0, 3.0, 9.0])
    assert len(found) == 6


def test_a_grid_leaves_out_what_differs_only_where_it_has_no_effect() -> None:
    # the threshold belongs to a method of stage 1 that is chosen by nobody here
    varied = (
        Varied("jpda.clutter_rate", 1.0, 9.0, steps=3),
        Varied("fusion.clutter_rate", 1.0, 9.0, steps=2),
    )
    assert len(list(space.grid(varied, [BASE]))) == 2
