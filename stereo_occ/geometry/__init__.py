"""Frames, units and names, stated once.

========  ==============================================  ===========================================================
frame     origin                                          axes
========  ==============================================  ===========================================================
object    centre of the mesh's bounding box               the mesh file's own axes; the box's diagonal is 1
rig       the fixation point, where the optical axes meet  +X right, +Y up, +Z towards the cameras; right-handed, metres
camera    optical centre                                  OpenCV: +X right, +Y down, +Z forward; metres
pixel     centre of the top-left pixel is (0, 0)          u right, v down
========  ==============================================  ===========================================================

- Points are row vectors ``(..., N, 3)``; a transform ``target_from_source`` is a 4x4 matrix applied with
  :func:`~stereo_occ.geometry.camera.transform_points`.
- A pose places the object in the rig: ``points_rig = scale * points_object @ rotation.T + center``. Every query,
  label and mesh that meets an image is in the rig frame.
- A ``W`` pixels wide image spans ``u = -0.5 .. W - 0.5``, so the principal point of a centred camera is
  ``(W - 1) / 2``. The matching rule of ``torch.nn.functional.grid_sample`` is ``align_corners=False`` on
  :func:`~stereo_occ.geometry.camera.normalize_pixels`, whatever the stride of the sampled features.
- Disparity is ``u_left - u_right``. A toed-in rig has disparity 0 at the fixation point, positive in front of it
  (towards the cameras) and negative behind.
- The working volume is the cube ``[-0.5, 0.5]^3`` of the rig frame.
"""
