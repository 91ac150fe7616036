"""Grids around objects, and the network that finds them."""

import torch

from stereo_occ.models.grid import MARGIN, Grid, Locator, locator_loss, whole_cube
from stereo_occ.models.sampling import cell_centers

GRID = Grid(torch.tensor([[0.1, -0.2, 0.3], [0.0, 0.1, 0.0]]), torch.tensor([0.5, 0.25]))


def test_a_grids_own_coordinates_run_from_minus_a_half_to_a_half():
    corners = torch.tensor([[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5], [0, 0, 0.5]])
    expected = torch.tensor(
        [
            [[-0.15, -0.45, 0.05], [0.35, 0.05, 0.55], [0.1, -0.2, 0.55]],
            [[-0.125, -0.025, -0.125], [0.125, 0.225, 0.125], [0, 0.1, 0.125]],
        ]
    )
    torch.testing.assert_close(GRID.to_rig(corners), expected)
    torch.testing.assert_close(GRID.to_local(expected), corners.expand(2, -1, -1))


def test_in_the_working_cube_the_coordinates_are_those_of_the_rig():
    points = torch.rand(3, 7, 3) - 0.5
    torch.testing.assert_close(whole_cube(3, points.device).to_local(points), points)


def test_the_loss_is_zero_for_the_cube_around_the_occupied_points_alone():
    points = torch.rand(2, 3000, 3) - 0.5
    occupied = (points[..., 0].abs() < 0.2).float() * (points[..., 1:].abs() < 0.1).all(dim=-1)
    boxes = [points[i][occupied[i] > 0] for i in range(2)]
    center = torch.stack([(box.amin(0) + box.amax(0)) / 2 for box in boxes])
    side = MARGIN * torch.stack([(box.amax(0) - box.amin(0)).max() for box in boxes])
    assert locator_loss(Grid(center, side), points, occupied) < 1e-9
    assert locator_loss(Grid(center + 0.05, side), points, occupied) > 0.1
    assert locator_loss(Grid(center, 1.2 * side), points, occupied) > 0.1


def test_a_sample_without_occupied_points_asks_for_nothing():
    points = torch.rand(2, 50, 3) - 0.5
    grid = Grid(torch.zeros(2, 3, requires_grad=True), torch.ones(2, requires_grad=True))
    loss = locator_loss(grid, points, torch.zeros(2, 50))
    loss.backward()
    assert loss == 0
    assert not grid.center_B3.grad.any()
    assert not grid.side_B.grad.any()


def test_the_locator_learns_to_find_a_blob():
    torch.manual_seed(0)
    locator = Locator(8, 8)
    optimizer = torch.optim.Adam(locator.parameters(), lr=0.01)
    cells = cell_centers(8)

    def batch(seed):
        generator = torch.Generator().manual_seed(seed)
        center = 0.5 * torch.rand(16, 1, 3, generator=generator) - 0.25
        half = 0.1 + 0.15 * torch.rand(16, 1, 1, generator=generator)
        inside = ((cells - center).abs() < half).all(dim=-1).float()
        points = center + 2 * half * (torch.rand(16, 400, 3, generator=generator) - 0.5)
        return inside.view(16, 1, 8, 8, 8).expand(-1, 8, -1, -1, -1), points

    for step in range(120):
        volume, points = batch(step)
        loss = locator_loss(locator(volume), points, torch.ones(16, 400))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    volume, points = batch(1000)
    with torch.no_grad():
        grid = locator.eval()(volume)
    assert (grid.center_B3 - points.mean(dim=1)).abs().mean() < 0.03
