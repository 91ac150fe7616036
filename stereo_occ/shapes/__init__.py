"""Objects: watertight meshes in the object frame, procedural or from files."""
