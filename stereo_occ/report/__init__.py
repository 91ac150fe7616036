"""One page about several evaluations, with the meshes in it, and a Markdown version of it.

Everything on it is read from the folders that ``python -m stereo_occ.evaluate`` wrote; no network is run.
"""
