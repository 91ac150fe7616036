"""Evidence of pairs, and the volume swept over the cube."""

import numpy as np
import pytest
import torch
from rigs import HEIGHT, WIDTH, cameras_VB, random_pairs, random_rig

from stereo_occ.errors import UserError
from stereo_occ.models.evidence import PairEvidence, groupwise_correlation, positional_encoding
from stereo_occ.models.grid import Grid, whole_cube
from stereo_occ.models.light import LightEncoder
from stereo_occ.models.pixel_stereo import CalibratedMaps
from stereo_occ.models.plane_sweep import PlaneSweepStereoModel, SweptVolume
from stereo_occ.models.sampling import Projections, sample_volume
from stereo_occ.models.unet3d import UNet3d

CHANNELS = 48


def texture(points_N2, seed=0):
    """Random waves ``(N, CHANNELS)`` over a plane, down to 0.1 m long."""
    rng = np.random.default_rng(seed)
    waves, phases = rng.uniform(-60, 60, (2, CHANNELS)), rng.uniform(0, 2 * np.pi, CHANNELS)
    return np.cos(points_N2 @ waves + phases)


def image_of_plane(camera, z):
    """What the camera sees of the textured plane at ``z``: ``(CHANNELS, HEIGHT, WIDTH)``."""
    v, u = np.meshgrid(np.arange(HEIGHT), np.arange(WIDTH), indexing="ij")
    pixels = np.stack([u, v], axis=-1).reshape(-1, 2)
    along = camera.unproject(pixels, np.ones(len(pixels))) - camera.center
    points = camera.center + along * ((z - camera.center[2]) / along[:, 2])[:, None]
    return texture(points[:, :2]).T.reshape(CHANNELS, HEIGHT, WIDTH)


def maps_of(rigs, images):
    features = torch.tensor(np.array(images)).float()
    return CalibratedMaps(features, features, *cameras_VB(rigs))


def correlations(maps, points_BN3):
    """Correlation and the flag that both views see, each ``(B, N)``."""
    evidence = PairEvidence(CHANNELS, 1, CHANNELS, torch.square)
    torch.nn.init.dirac_(evidence.reduce.weight)
    torch.nn.init.zeros_(evidence.reduce.bias)
    with torch.no_grad():
        values = evidence(maps.features_VBCHW, maps.project(torch.as_tensor(points_BN3).float())).numpy()
    return values[:, CHANNELS], values[:, -2] > 0


def test_correlation_along_a_line_of_sight_peaks_at_the_textured_plane():
    rng = np.random.default_rng(0)
    pixels = np.stack([rng.uniform(12, WIDTH - 12, 40), rng.uniform(10, HEIGHT - 10, 40)], axis=-1)
    offsets = np.linspace(-0.4, 0.4, 161)  # metres in z from the plane, every 5 mm
    errors = []
    for _ in range(8):
        rig, z = random_rig(rng), rng.uniform(-0.2, 0.2)
        maps = maps_of([rig], [[image_of_plane(camera, z)] for camera in rig.cameras])
        along = rig.left.unproject(pixels, np.ones(len(pixels))) - rig.left.center
        steps = (z + offsets[:, None] - rig.left.center[2]) / along[:, 2]
        points = rig.left.center + steps[..., None] * along
        values, seen = (a.reshape(points.shape[:2]) for a in correlations(maps, points.reshape(1, -1, 3)))
        known = seen.all(axis=0)
        errors.append(offsets[np.where(seen, values, -1).argmax(axis=0)][known])
        np.testing.assert_allclose(values[80][known], 0.5, atol=0.25)  # mean of squared cosines
    errors = np.concatenate(errors)
    assert len(errors) > 100
    assert np.abs(errors).max() <= 0.05  # a pixel of disparity
    assert np.abs(errors).mean() <= 0.015
    assert np.abs(errors.mean()) <= 0.005


def test_groupwise_correlation_is_the_mean_product_of_each_group():
    left, right = torch.randn(2, 3, 6, 5)
    expected = [(left[:, g : g + 2] * right[:, g : g + 2]).mean(dim=1) for g in (0, 2, 4)]
    torch.testing.assert_close(groupwise_correlation(left, right, 3), torch.stack(expected, dim=1))


def test_positional_encoding_has_sines_and_cosines_of_each_frequency():
    points = torch.tensor([[[0.5, 0.25, -0.125]]])
    code = positional_encoding(points, 2)[0, 0]
    torch.testing.assert_close(code[:3], points[0, 0])
    angles = torch.pi * torch.tensor([0.5, 1, 0.25, 0.5, -0.125, -0.25])
    torch.testing.assert_close(code[3:], torch.cat([angles.sin(), angles.cos()]))


def test_evidence_of_a_point_by_hand():
    """Two cameras of one channel, and a point that both see: read, placed, rectified, averaged, compared."""
    evidence = PairEvidence(1, 1, 2, torch.square)
    with torch.no_grad():
        evidence.reduce.weight.copy_(torch.tensor([1.0, -1.0]).view(2, 1, 1, 1))
        evidence.reduce.bias.copy_(torch.tensor([0.5, 0.0]))
        evidence.place.weight.copy_(torch.tensor([[1.0, 0, 0, 0], [0, 2.0, -1.0, 3.0]]))
        features = torch.tensor([2.0, -1.0]).view(2, 1, 1, 1, 1).expand(2, 1, 1, 4, 4)
        offsets = torch.tensor([[0.1, 0.2, 0.3], [-0.4, 0.5, 0.6]]).view(2, 1, 1, 3)
        depths = torch.tensor([1.0, 2.0]).view(2, 1, 1)
        points = Projections(torch.zeros(2, 1, 1, 2), torch.ones(2, 1, 1), offsets, depths)
        found = evidence(features, points)[0, :, 0]
    left, right = (2.5, -2.0), (-0.5, 1.0)  # read
    first = (max(left[0] + 0.1, 0) + max(right[0] - 0.4, 0)) / 2
    second = (max(left[1] + 2 * 0.2 - 0.3, 0) + max(right[1] + 2 * 0.5 - 0.6 + 3 * np.log(2), 0)) / 2
    correlation = (left[0] * right[0] + left[1] * right[1]) / 2
    expected = [first, second, correlation, (left[0] - right[0]) ** 2, (left[1] - right[1]) ** 2, 1.0, 1.0]
    torch.testing.assert_close(found, torch.tensor(expected, dtype=torch.float32))


def pair_maps(batch=3, seed=0):
    rng = np.random.default_rng(seed)
    rigs = [random_rig(rng) for _ in range(batch)]
    return maps_of(rigs, rng.standard_normal((2, batch, 8, HEIGHT, WIDTH)))


def one_view(maps, view):
    return CalibratedMaps(
        maps.features_VBCHW[view : view + 1],
        maps.images_VB3HW[view : view + 1],
        maps.K_VB33[view : view + 1],
        maps.camera_from_rig_VB44[view : view + 1],
    )


def test_a_point_that_one_view_sees_has_that_views_evidence_and_no_comparison():
    maps, evidence = pair_maps(), PairEvidence(8, 2, 4, torch.abs)
    points = 3 * torch.rand(3, 400, 3) - 1.5
    with torch.no_grad():
        pair, left, right = (
            evidence(m.features_VBCHW, m.project(points)).mT
            for m in (maps, one_view(maps, 0), one_view(maps, 1))
        )
    seen = maps.project(points).visible_VBN.bool()
    for alone, here, there in ((left, *seen), (right, *seen.flip(0))):
        assert (here & ~there).sum() > 20
        torch.testing.assert_close(pair[here & ~there], alone[here & ~there])
        assert not alone[..., 4:-1].any()
    assert not pair[~seen.any(dim=0)].any()
    both = seen.all(dim=0)
    torch.testing.assert_close(pair[both][:, :4], (left[both][:, :4] + right[both][:, :4]) / 2)
    assert (pair[both][:, 4:-2] != 0).all()
    torch.testing.assert_close(pair[both][:, -2:], torch.ones(int(both.sum()), 2))


@pytest.mark.parametrize("around", ["cube", "object"])
def test_the_volume_at_a_cells_centre_is_the_evidence_of_that_point(around):
    maps, sweep = pair_maps(), SweptVolume(8, 2, cells=6, width=6)
    grid = whole_cube(3, torch.device("cpu"))
    if around == "object":
        grid = Grid(torch.tensor([[0.1, -0.2, 0], [0, 0.1, 0.2], [0, 0, 0]]), torch.tensor([0.5, 0.4, 1]))
    centers = sweep.centers_N3.expand(3, -1, -1)
    with torch.no_grad():
        volume = sweep(maps, grid)
        evidence = sweep.evidence(maps.features_VBCHW, maps.project(grid.to_rig(sweep.centers_N3)))
        expected = evidence.mT @ sweep.merge.weight.T + sweep.place(centers)
    assert volume.shape == (3, 6, 6, 6, 6)
    torch.testing.assert_close(sample_volume(volume, centers).mT, expected)


def test_a_volume_network_sees_the_whole_grid_and_keeps_its_axes():
    torch.manual_seed(0)
    network = UNet3d([8, 8, 8, 8]).eval()
    volume = torch.randn(1, 8, 8, 8, 8)
    poked = volume.clone()
    poked[..., 0, 0, 0] += 1
    with torch.no_grad():
        changed = (network(poked) - network(volume)).abs().sum(dim=1)[0]
    assert changed[-1, -1, -1] > 0
    assert changed.argmax() == 0


def test_a_grid_that_cannot_be_halved_is_refused():
    encoder = LightEncoder(stride=4, channels=8, widths=[8, 8, 8, 8], blocks=[1, 1, 1, 1])
    settings = {"views": "both", "groups": 2, "frequencies": 2, "code_size": 8, "hidden": 8, "blocks": 1}
    with pytest.raises(UserError, match=r"model\.grid: must be a multiple of 4 for 3 model\.widths, got 10"):
        PlaneSweepStereoModel(encoder, grid=10, widths=[4, 4, 4], **settings)


def test_a_grid_around_something_else_is_refused():
    encoder = LightEncoder(stride=4, channels=8, widths=[8, 8, 8, 8], blocks=[1, 1, 1, 1])
    settings = {"views": "both", "groups": 2, "frequencies": 2, "code_size": 8, "hidden": 8, "blocks": 1}
    with pytest.raises(UserError, match=r"model\.around: must be one of cube, object, got mug"):
        PlaneSweepStereoModel(encoder, grid=4, around="mug", widths=[4, 4], **settings)


def test_groups_must_divide_the_channels():
    with pytest.raises(UserError, match=r"model\.groups: must divide the 4 channels of the evidence, got 3"):
        PairEvidence(8, 3, 4, torch.abs)


def test_the_volume_alone_tells_samples_apart():
    torch.manual_seed(0)
    encoder = LightEncoder(stride=4, channels=8, widths=[8, 8, 8, 8], blocks=[1, 1, 1, 1])
    model = PlaneSweepStereoModel(
        encoder, grid=4, widths=[4, 4], views="both", groups=2, frequencies=2, code_size=8, hidden=8, blocks=1
    ).eval()
    with torch.no_grad():
        code = model.encode(random_pairs(2))
        points = torch.rand(2, 30, 3) - 0.5
        same = model.token(code, points, code.maps.project(points))
        code.volume_BCDHW[1] += 1
        other = model.token(code, points, code.maps.project(points))
    torch.testing.assert_close(same[0], other[0])
    torch.testing.assert_close(same[1, :, :-4], other[1, :, :-4])
    torch.testing.assert_close(same[1, :, -4:] + 1, other[1, :, -4:])


def test_the_volume_lies_where_the_locator_puts_it():
    torch.manual_seed(0)
    encoder = LightEncoder(stride=4, channels=8, widths=[8, 8, 8, 8], blocks=[1, 1, 1, 1])
    settings = {"views": "both", "groups": 2, "frequencies": 2, "code_size": 8, "hidden": 8, "blocks": 1}
    model = PlaneSweepStereoModel(encoder, grid=4, around="object", widths=[4, 4], **settings).eval()
    cube = whole_cube(2, torch.device("cpu"))
    points = torch.rand(2, 30, 3) - 0.5
    with torch.no_grad():
        code = model.encode(random_pairs(2))
        found = model.locator(model.scout(code.maps, cube))
        volume = model.unet(model.sweep(code.maps, found))
        token = model.token(code, points, code.maps.project(points))
    assert (code.grid.side_B < 0.9).all()
    torch.testing.assert_close(code.grid.center_B3, found.center_B3)
    torch.testing.assert_close(code.volume_BCDHW, volume)
    local = (points - found.center_B3[:, None]) / found.side_B[:, None, None]
    torch.testing.assert_close(token[..., -7:-3], sample_volume(volume, local).mT)
    torch.testing.assert_close(token[..., -3:], local.clamp(-1, 1))


def test_guidance_teaches_what_finds_the_object_and_the_logits_what_is_in_the_grid():
    torch.manual_seed(0)
    encoder = LightEncoder(stride=4, channels=8, widths=[8, 8, 8, 8], blocks=[1, 1, 1, 1])
    settings = {"views": "both", "groups": 2, "frequencies": 2, "code_size": 8, "hidden": 8, "blocks": 1}
    model = PlaneSweepStereoModel(encoder, grid=4, around="object", widths=[4, 4], **settings)
    points, occupied = torch.rand(3, 40, 3) - 0.5, torch.ones(3, 40)
    code = model.encode(random_pairs(3))
    parts = {"locator": model.locator, "scout": model.scout, "sweep": model.sweep, "unet": model.unet}

    def taught(value):
        model.zero_grad()
        value.backward(retain_graph=True)
        grads = {name: [p.grad for p in part.parameters()] for name, part in parts.items()}
        return {name for name, g in grads.items() if any(x is not None and x.any() for x in g)}

    assert taught(model.guidance(code, points, occupied)) == {"locator", "scout"}
    assert taught(model.decode(code, points).sum()) == {"sweep", "unet"}


def test_gradients_in_half_precision_are_nearly_those_in_single_down_to_the_coarsest_level():
    torch.manual_seed(0)
    unet = UNet3d([16, 32, 64, 128])
    volume = torch.randn(4, 16, 16, 16, 16)

    def gradients(half):
        with torch.autocast("cpu", torch.bfloat16, enabled=half):
            loss = unet(volume).float().square().mean()
        return torch.autograd.grad(loss, list(unet.parameters()))

    for name, single, half in zip(
        dict(unet.named_parameters()), gradients(False), gradients(True), strict=True
    ):
        assert torch.cosine_similarity(single.flatten(), half.flatten(), dim=0) > 0.95, name
