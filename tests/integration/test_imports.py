"""What programs need not wait for."""

from runs import program

PROGRAMS = ("compare", "export", "inspect", "reconstruct", "render.__main__")


def test_programs_that_do_not_train_start_without_lightning_and_torchvision(tmp_path):
    imports = ", ".join(f"stereo_occ.{name}" for name in PROGRAMS)
    code = f"import sys, {imports}; print({{'lightning', 'torchvision'}} & set(sys.modules))"
    done = program("-c", code, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "set()\n"), done.stderr
