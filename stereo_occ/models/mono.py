"""The paper's baseline: an occupancy network on the left image."""

from torch import Tensor, nn

from stereo_occ.models.base import OccupancyModel, StereoViews
from stereo_occ.models.decoders import ONet
from stereo_occ.models.encoders import ImageEncoder


class MonoModel(OccupancyModel):
    """Encoder, mean over the image, code, decoder (section 3.4 of the paper); ignores the right image."""

    def __init__(self, encoder: ImageEncoder, decoder: ONet, code_size: int) -> None:
        super().__init__()
        self.encoder = encoder
        self.code = nn.Linear(encoder.channels, code_size)
        self.decoder = decoder

    def encode(self, views: StereoViews) -> Tensor:
        """Codes ``(B, code_size)``."""
        code_BC: Tensor = self.code(self.encoder(views.left_BCHW).mean(dim=(2, 3)))
        return code_BC

    def decode(self, code: Tensor, points_BN3: Tensor) -> Tensor:
        """Logits ``(B, N)``."""
        logits_BN: Tensor = self.decoder(code, points_BN3)
        return logits_BN
