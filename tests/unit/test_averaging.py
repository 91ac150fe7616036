"""The moving average of the weights: its values, and that it changes places with the weights and back."""

import pytest
import torch
from torch import nn

from stereo_occ.averaging import AveragingConfig, WeightAverage


def model_of(value):
    model = nn.Sequential(nn.Linear(2, 3), nn.BatchNorm1d(3))
    set_all(model, value)
    return model


def set_all(model, value):
    for tensor in model.state_dict().values():
        tensor.fill_(value)


def values(state):
    return {float(tensor.flatten()[0]) for tensor in state.values()}


def test_there_is_none_by_default():
    assert AveragingConfig().decay is None


@pytest.mark.parametrize("decay", [0.0, 0.5, 0.999])
def test_each_step_keeps_its_share_of_the_former_average(decay):
    model = model_of(1.0)
    average, expected = WeightAverage(model, decay), 1.0
    for step, value in enumerate([5, 3, 8, 2]):
        set_all(model, value)
        average.update(step)
        keep = min(decay, (1 + step) / (10 + step))
        expected = keep * expected + (1 - keep) * value
    averaged, weights = average.state()
    for name, tensor in averaged.items():
        assert float(tensor.flatten()[0]) == pytest.approx(2 if "num_batches" in name else expected), name
    assert values(weights) == {2}
    assert {n: t.dtype for n, t in averaged.items()} == {n: t.dtype for n, t in weights.items()}


def test_average_and_weights_change_places_and_back():
    model = model_of(1.0)
    average = WeightAverage(model, 0.5)
    set_all(model, 4)
    for in_use in (True, False):
        average.swap()
        assert average.in_use is in_use
        assert values(model.state_dict()) == ({1.0} if in_use else {4.0})
        assert tuple(map(values, average.state())) == ({1.0}, {4.0})


def test_it_goes_on_from_what_it_was():
    first, second = (WeightAverage(model_of(1.0), 0.5) for _ in range(2))
    for step in range(3):
        set_all(first.model, step)
        first.update(step)
    set_all(second.model, 2)
    second.load(first.state()[0])
    for average in (first, second):
        set_all(average.model, 7)
        average.update(3)
    for a, b in zip(first.state()[0].values(), second.state()[0].values(), strict=True):
        assert torch.equal(a, b)
