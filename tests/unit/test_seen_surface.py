"""Lines of sight, the depth found along them, and how far points are said to be behind it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from rigs import HEIGHT, WIDTH, cameras_VB, random_rig

from stereo_occ.models.grid import Grid, whole_cube
from stereo_occ.models.pixel_stereo import CalibratedMaps
from stereo_occ.models.sampling import cell_centers
from stereo_occ.models.seen_surface import NEAR, REACH, SCALES, SeenSurface, lines_of_sight

STRIDE = 4
CELLS = 16


@pytest.fixture
def rigs():
    rng = np.random.default_rng(0)
    return [random_rig(rng) for _ in range(3)]


@pytest.fixture(autouse=True)
def _no_gradients():
    with torch.no_grad():
        yield


def maps_of(rigs):
    features = torch.zeros(2, len(rigs), 5, HEIGHT // STRIDE, WIDTH // STRIDE)
    images = torch.zeros(2, len(rigs), 3, HEIGHT, WIDTH)
    return CalibratedMaps(features, images, *cameras_VB(rigs))


def surface_of(width=1):
    """Whose score is the first channel of the volume."""
    torch.manual_seed(0)
    surface = SeenSurface(5, width, 6)
    torch.nn.init.dirac_(surface.score.weight)
    return surface


def truthful(surface):
    """Points are told the very numbers that the layer is given."""
    torch.nn.init.eye_(surface.tell.weight)
    torch.nn.init.zeros_(surface.tell.bias)
    return surface


def test_lines_of_sight_go_through_their_cells_at_the_depths_asked_for(rigs):
    depths = torch.tensor([-0.3, 0.0, 0.2])
    points = lines_of_sight(maps_of(rigs), depths).double().numpy()
    assert points.shape == (2, 3, HEIGHT * WIDTH // STRIDE**2, 3, 3)
    across, down = np.arange(WIDTH // STRIDE), np.arange(HEIGHT // STRIDE)
    cells = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    for view, of_view in enumerate(points):
        for rig, of_rig in zip(rigs, of_view, strict=True):
            camera = rig.cameras[view]
            for index, depth in enumerate(depths):
                pixels, found = camera.project(of_rig[:, index])
                np.testing.assert_allclose(pixels, STRIDE * cells + (STRIDE - 1) / 2, atol=1e-3)
                np.testing.assert_allclose(found, camera.camera_from_rig[2, 3] + float(depth), atol=1e-5)


@pytest.mark.parametrize(
    "grid", [None, Grid(torch.tensor([[0.1, 0.0, -0.05]]).expand(3, 3), torch.full((3,), 0.8))]
)
def test_a_plane_in_the_volume_is_found_along_every_line_of_sight_that_meets_it(rigs, grid):
    grid = grid or whole_cube(3, torch.device("cpu"))
    normal, offset = torch.tensor([0.1, 0.2, 0.97]), 0.07
    centers_BN3 = grid.to_rig(cell_centers(CELLS))
    distances = (centers_BN3 @ normal - offset).view(3, 1, CELLS, CELLS, CELLS)
    maps = maps_of(rigs)
    found = surface_of()(-600 * distances.square(), grid, maps)
    assert found.shape == (2, 3, 2, HEIGHT // STRIDE, WIDTH // STRIDE)
    dense = torch.linspace(-REACH, REACH, 1201)
    lines = lines_of_sight(maps, dense)
    nearest = (lines @ normal - offset).abs().min(dim=-1)
    inside = (grid.to_local(lines.transpose(0, 1).flatten(1, 3)).abs() < 0.4).all(-1)
    inside = inside.view(3, 2, -1, len(dense)).transpose(0, 1)
    meets = (nearest.values < 2e-3) & inside.gather(-1, nearest.indices[..., None])[..., 0]
    assert meets.sum() > 200
    errors = (found[:, :, 0].flatten(2) - dense[nearest.indices])[meets]
    assert errors.abs().median() < 0.003
    assert errors.abs().max() < 0.02


def test_an_untrained_surface_is_what_the_volume_says_whatever_the_pictures_show(rigs):
    surface, volume, grid = surface_of(), torch.randn(3, 1, 8, 8, 8), whole_cube(3, torch.device("cpu"))
    blank = maps_of(rigs)
    busy = replace(blank, features_VBCHW=torch.randn(blank.features_VBCHW.shape))
    torch.testing.assert_close(surface(volume, grid, blank), surface(volume, grid, busy))


def test_where_a_line_of_sight_misses_the_volume_the_answer_is_of_no_place(rigs):
    far = Grid(torch.tensor([[5.0, 5.0, 5.0]]).expand(3, 3), torch.ones(3))
    depths, spreads = surface_of()(torch.randn(3, 1, 8, 8, 8), far, maps_of(rigs)).unbind(2)
    torch.testing.assert_close(depths, torch.zeros_like(depths), atol=1e-6, rtol=0)
    assert (spreads > 0.5 * REACH).all()


def test_points_are_told_how_far_they_are_behind_what_each_view_sees(rigs):
    surface, maps = truthful(surface_of()), maps_of(rigs)
    points = torch.rand(3, 50, 3) * 0.3 - 0.15
    projections = maps.project(points)
    assert projections.visible_VBN.all()
    at = torch.tensor([0.05, -0.1]).view(2, 1, 1, 1, 1)  # left views and right ones
    found = torch.cat([at.expand(2, 3, 1, 12, 16), torch.full((2, 3, 1, 12, 16), 0.04)], dim=2)
    behind = projections.offsets_VBN3[..., 2] - at[..., 0, 0]
    squashed = [torch.tanh(behind / scale) for scale in SCALES]
    given = torch.stack(
        [behind, *squashed, torch.full_like(behind, 0.04), (-((behind / NEAR) ** 2)).exp()], -1
    )
    torch.testing.assert_close(
        surface.tell_points(found, projections), given.relu().mean(0), atol=1e-5, rtol=1e-4
    )


def test_what_one_view_does_not_see_the_other_tells_and_none_is_nothing(rigs):
    surface, maps = truthful(surface_of()), maps_of(rigs)
    projections = maps.project(torch.rand(3, 4, 3) * 0.2 - 0.1)
    projections.visible_VBN[:] = torch.tensor([[1.0, 1, 0, 0], [1, 0, 1, 0]])[:, None]
    found = torch.stack([torch.full((2, 3, 12, 16), -0.5), torch.zeros(2, 3, 12, 16)], dim=2)
    told = surface.tell_points(found, projections)[..., 0]
    left, right = projections.offsets_VBN3[..., 2] + 0.5
    torch.testing.assert_close(told[:, 0], (left + right)[:, 0] / 2)
    torch.testing.assert_close(told[:, 1], left[:, 1])
    torch.testing.assert_close(told[:, 2], right[:, 2])
    assert not told[:, 3].any()
