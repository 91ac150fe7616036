import pytest
import torch
from torch import nn

from stereo_occ.config import OptimizerConfig, SchedulerConfig
from stereo_occ.optimization import build_optimizer, build_schedule

ADAM = OptimizerConfig("adam", lr=0.01, betas=[0.9, 0.999], weight_decay=0.0)


def rates(scheduler, steps):
    """The learning rate of every step, as a share of the optimiser's."""
    optimizer = build_optimizer(ADAM, nn.Linear(2, 2))
    schedule = build_schedule(scheduler, optimizer, steps)
    shares = []
    for _ in range(steps):
        shares.append(optimizer.param_groups[0]["lr"] / ADAM.lr)
        optimizer.step()
        schedule.step()
    return shares


def test_constant():
    assert rates(SchedulerConfig("constant", warmup=0, final=1.0), 5) == [1] * 5


def test_warm_up_is_linear_and_never_zero():
    assert rates(SchedulerConfig("constant", warmup=4, final=1.0), 6) == pytest.approx(
        [0.2, 0.4, 0.6, 0.8, 1, 1]
    )


def test_half_a_cosine():
    shares = rates(SchedulerConfig("cosine", warmup=0, final=0.0), 100)
    assert shares[0] == 1
    assert shares[50] == pytest.approx(0.5)
    assert shares[25] == pytest.approx((1 + 0.5**0.5) / 2)
    assert shares[99] < 0.001


def test_the_cosine_ends_at_its_final_share_after_the_warm_up():
    shares = rates(SchedulerConfig("cosine", warmup=10, final=0.1), 1000)
    assert shares[10] == 1
    assert shares[:11] == sorted(shares[:11])
    assert shares[10:] == sorted(shares[10:], reverse=True)
    assert shares[505] == pytest.approx((1 + 0.1) / 2)
    assert shares[-1] == pytest.approx(0.1, abs=1e-4)


def test_a_cosine_that_is_all_warm_up():
    assert rates(SchedulerConfig("cosine", warmup=3, final=0.0), 3) == pytest.approx([0.25, 0.5, 0.75])


@pytest.mark.parametrize(("name", "kind"), [("adam", torch.optim.Adam), ("adamw", torch.optim.AdamW)])
def test_settings_reach_the_optimizer(name, kind):
    optimizer = build_optimizer(OptimizerConfig(name, 0.02, [0.8, 0.9], 0.3), nn.Linear(2, 2))
    assert type(optimizer) is kind
    group = optimizer.param_groups[0]
    assert (group["lr"], tuple(group["betas"]), group["weight_decay"]) == (0.02, (0.8, 0.9), 0.3)
    assert sum(len(g["params"]) for g in optimizer.param_groups) == 2


def test_adamw_decays_weights_even_without_a_gradient():
    for name, factor in (("adam", 1.0), ("adamw", 1 - 0.1 * 0.5)):
        layer = nn.Linear(1, 1, bias=False)
        nn.init.ones_(layer.weight)
        optimizer = build_optimizer(OptimizerConfig(name, 0.1, [0.9, 0.999], 0.5 * (name == "adamw")), layer)
        layer.weight.grad = torch.zeros_like(layer.weight)
        optimizer.step()
        assert layer.weight.item() == pytest.approx(factor)
