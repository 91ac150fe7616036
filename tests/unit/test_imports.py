"""What programs need not wait for."""

import subprocess
import sys

PROGRAMS = ("compare", "export", "inspect", "reconstruct", "render.__main__")


def test_programs_that_do_not_train_start_without_lightning_and_torchvision():
    imports = ", ".join(f"stereo_occ.{name}" for name in PROGRAMS)
    code = f"import sys, {imports}; print({{'lightning', 'torchvision'}} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
