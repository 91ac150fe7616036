"""The ONet decoder and its conditional batch norm."""

import pytest
import torch
from torch.nn.functional import batch_norm

from stereo_occ.models.decoders import ConditionalBatchNorm, ConditionalBlock, ONet


@pytest.fixture
def decoder():
    torch.manual_seed(0)
    return ONet(16, hidden=8, blocks=2)


@pytest.fixture
def trained(decoder):
    """A decoder in eval mode with nothing left at its initial value."""
    for parameter in decoder.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    for _ in range(3):
        decoder(torch.randn(4, 16), torch.rand(4, 50, 3))
    return decoder.eval()


def unit_modulation(count, batch, channels):
    return iter([torch.stack([torch.ones(batch, 1, channels), torch.zeros(batch, 1, channels)])] * count)


def test_initial_conditional_batch_norm_is_plain_batch_norm_over_samples_and_points():
    norm = ConditionalBatchNorm(8)
    x = torch.randn(4, 50, 8) * 3 + 1
    expected = ((x - x.mean(dim=(0, 1))) / (x.var(dim=(0, 1), correction=0) + 1e-5).sqrt()).relu()
    torch.testing.assert_close(norm(x, torch.ones(4, 1, 8), torch.zeros(4, 1, 8)), expected)
    torch.testing.assert_close(norm.norm.running_mean, 0.1 * x.mean(dim=(0, 1)))


def test_each_sample_has_its_own_gain_and_bias():
    norm = ConditionalBatchNorm(8)
    x, gain, bias = torch.randn(4, 50, 8), torch.randn(4, 1, 8), torch.randn(4, 1, 8)
    plain = batch_norm(x.flatten(0, 1), None, None, training=True).view_as(x)
    torch.testing.assert_close(norm(x, gain, bias), (plain * gain + bias).relu())


def test_eval_mode_uses_running_statistics():
    norm = ConditionalBatchNorm(8).eval()
    norm.norm.running_mean.normal_()
    norm.norm.running_var.uniform_(0.5, 2)
    x, gain, bias = torch.randn(4, 50, 8), torch.randn(4, 1, 8), torch.randn(4, 1, 8)
    plain = batch_norm(x.flatten(0, 1), norm.norm.running_mean, norm.norm.running_var).view_as(x)
    torch.testing.assert_close(norm(x, gain, bias), (plain * gain + bias).relu())


def test_initial_blocks_are_the_identity():
    x = torch.randn(4, 50, 8)
    torch.testing.assert_close(ConditionalBlock(8)(x, unit_modulation(2, 4, 8)), x, atol=0, rtol=0)


def test_initial_decoder_ignores_the_code(decoder):
    points = torch.rand(4, 50, 3)
    torch.testing.assert_close(decoder(torch.randn(4, 16), points), decoder(torch.randn(4, 16), points))


def test_initial_decoder_is_one_hidden_layer_on_normalised_points(decoder):
    points = torch.rand(4, 50, 3) - 0.5
    hidden = batch_norm((points @ decoder.embed.weight.T).flatten(0, 1), None, None, training=True).relu()
    expected = (hidden @ decoder.head.weight.T + decoder.head.bias).view(4, 50)
    torch.testing.assert_close(decoder(torch.zeros(4, 16), points), expected, atol=1e-5, rtol=1e-5)


def test_a_code_that_cancels_gains_leaves_the_last_bias(trained):
    torch.nn.init.zeros_(trained.modulate.weight)
    torch.nn.init.zeros_(trained.modulate.bias)
    logits = trained(torch.randn(2, 16), torch.rand(2, 5, 3))
    torch.testing.assert_close(logits, trained.head.bias.expand(2, 5))


def test_answers_do_not_depend_on_how_many_points_are_asked(trained):
    code, points = torch.randn(3, 16), torch.rand(3, 1000, 3) - 0.5
    with torch.no_grad():
        together = trained(code, points)
        apart = torch.cat([trained(code, chunk) for chunk in points.split([1, 2, 900, 97], dim=1)], dim=1)
        reversed_order = trained(code, points.flip(1)).flip(1)
    assert together.std() > 0.01
    torch.testing.assert_close(together, apart)
    torch.testing.assert_close(together, reversed_order)


def test_answers_do_not_depend_on_the_other_samples(trained):
    code, points = torch.randn(3, 16), torch.rand(3, 20, 3)
    with torch.no_grad():
        torch.testing.assert_close(trained(code, points)[1:2], trained(code[1:2], points[1:2]))


def test_the_code_matters_after_training(trained):
    points = torch.rand(1, 20, 3)
    with torch.no_grad():
        assert (trained(torch.randn(1, 16), points) - trained(torch.randn(1, 16), points)).abs().max() > 1e-3


def test_logits_are_float32_and_close_under_autocast(trained):
    code, points = torch.randn(3, 16), torch.rand(3, 200, 3)
    with torch.no_grad():
        expected = trained(code, points)
        with torch.autocast("cpu", torch.bfloat16):
            logits = trained(code, points)
    assert logits.dtype == torch.float32
    assert (logits - expected).abs().max() < 0.05 * expected.abs().max()
