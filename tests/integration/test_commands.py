"""Every command in the README and on the pages of docs/ is one that works, every link leads somewhere."""

import re
import shlex
from pathlib import Path

import pytest
import torch

import stereo_occ
from stereo_occ.checks.evaluation import check_evaluation
from stereo_occ.checks.pairs import check_pairs, check_rendering
from stereo_occ.checks.training import check_training
from stereo_occ.export import check_export
from stereo_occ.problems import find_problems
from stereo_occ.reconstruct import check_reconstruction
from stereo_occ.report.__main__ import check_report

CHECKOUT = Path(stereo_occ.__file__).parents[1]
CHECKS = {
    "train": check_training,
    "evaluate": check_evaluation,
    "render": check_rendering,
    "inspect": check_pairs,
    "reconstruct": check_reconstruction,
    "export": check_export,
    "report": check_report,
}

WITHOUT_ARGUMENTS = {"doctor"}

#: What stands for the reader's own pair.
EXAMPLE_PAIR = {
    "left": ("left", CHECKOUT / "examples" / "left.png"),
    "right": ("right", CHECKOUT / "examples" / "right.png"),
    "rig": ("calibration", CHECKOUT / "examples" / "calibration.yaml"),
}

#: Programs of two folders, without a configuration.
OF_FOLDERS = {"compare"}


def code_lines(text):
    """The lines of the code blocks, continuations joined."""
    blocks = re.findall(r"^```\w*\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    return [line.strip() for block in blocks for line in block.replace("\\\n", " ").splitlines()]


PAGES = [CHECKOUT / "README.md", CHECKOUT / "CONTRIBUTING.md", *sorted((CHECKOUT / "docs").glob("*.md"))]

#: Its commands want the parts that it shows; test_extension.py runs them.
ELSEWHERE = {"extend.md"}


def lines_of_pages():
    return {line for page in PAGES if page.name not in ELSEWHERE for line in code_lines(page.read_text())}


def commands():
    return sorted(line for line in lines_of_pages() if "python -m stereo_occ" in line)


def make_targets():
    words = (shlex.split(line, comments=True) for line in lines_of_pages() if line.startswith("make "))
    return sorted({target for _, target, *_ in words})


def test_the_readme_shows_the_commands():
    lines = code_lines((CHECKOUT / "README.md").read_text())
    shown = {shlex.split(line, comments=True)[2] for line in lines if line.startswith("python -m stereo_occ")}
    assert shown >= {f"stereo_occ.{program}" for program in CHECKS}
    assert any(" -m " in line.partition("stereo_occ")[2] for line in commands())


@pytest.mark.parametrize("command", commands())
def test_a_command_of_the_pages_composes_without_problems(command, tmp_path, monkeypatch):
    """Files and folders that it names stand for the reader's own; a GPU is assumed."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    words = shlex.split(command, comments=True)
    words = words[words.index("python") :]
    assert words[:2] == ["python", "-m"]
    package, program = words[2].split(".")
    assert package == "stereo_occ"
    if program in WITHOUT_ARGUMENTS:
        assert words[3:] == []
        return
    if program in OF_FOLDERS:
        assert [word for word in words[3:] if word.startswith("-")] == []
        assert len(words[3:]) == 2
        return
    assert program in CHECKS, f"no test knows {words[2]}"
    (tmp_path / "x.ckpt").touch()
    overrides = []
    for word in words[3:]:
        key = word.partition("=")[0]
        stand_in = {"checkpoint": tmp_path / "x.ckpt", "data.root": tmp_path}.get(key)
        if program == "reconstruct" and key in EXAMPLE_PAIR:
            key, stand_in = EXAMPLE_PAIR[key]
        overrides.append(f"{key}={stand_in}" if stand_in else word)
    if overrides == ["--help"]:
        return
    config_dir = None
    if "--config-dir" in overrides:
        at = overrides.index("--config-dir")
        del overrides[at : at + 2]
        config_dir = tmp_path
        (tmp_path / "experiment").mkdir()
        (tmp_path / "experiment" / "mine.yaml").write_text("# @package _global_\nsteps: 30\n")
    flags = [word for word in overrides if word.startswith("-")]
    assert set(flags) <= {"-m", "--multirun"}
    values = [word for word in overrides if not word.startswith("-")]
    problems = find_problems(program, values, CHECKS[program], multirun=bool(flags), config_dir=config_dir)
    assert [problem for problem in problems if "pip install 'stereo-occ[" not in problem] == []


@pytest.mark.parametrize(
    "page",
    [*PAGES, *sorted((CHECKOUT / "experiments").rglob("README.md"))],
    ids=lambda page: str(page.relative_to(CHECKOUT)),
)
def test_links_lead_somewhere(page):
    """To files of this repository, and to headings in them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith("https://"):
            continue
        file, _, anchor = target.partition("#")
        linked = page.parent / file if file else page
        assert linked.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.*)$", linked.read_text(), flags=re.MULTILINE)
            slugs = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
            assert anchor in slugs, target


def test_the_readme_leads_to_every_page():
    readme = (CHECKOUT / "README.md").read_text()
    assert [
        page.name for page in PAGES if page.parent.name == "docs" and f"(docs/{page.name})" not in readme
    ] == []


def test_the_page_of_experiments_leads_to_every_folder_with_a_run():
    page = (CHECKOUT / "experiments" / "README.md").read_text()
    runs = {path.parent.name for path in (CHECKOUT / "experiments").glob("*/run.sh")}
    assert runs
    assert {name for name in runs if f"({name}/" not in page} == set()


def test_the_make_targets_of_the_readme_exist():
    makefile = (CHECKOUT / "Makefile").read_text()
    assert make_targets()
    for target in make_targets():
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target


def test_the_commands_of_the_makefile_compose(tmp_path):
    text = (CHECKOUT / "Makefile").read_text().replace("$(DEMO)", str(tmp_path))
    lines = re.findall(r"-m (stereo_occ\.\S+) (.*)$", text, flags=re.MULTILINE)
    assert {program for program, _ in lines} >= {"stereo_occ.train", "stereo_occ.evaluate"}
    for module, arguments in lines:
        program = module.split(".")[1]
        overrides = [word for word in shlex.split(arguments) if "=" in word]
        for word in overrides:
            if word.startswith("checkpoint="):
                path = Path(word.partition("=")[2])
                path.parent.mkdir(parents=True, exist_ok=True)
                path.touch()
        if program == "reconstruct":  # which takes its calibration= by another name
            overrides = [re.sub("^rig=", "calibration=", word) for word in overrides]
        assert find_problems(program, overrides, CHECKS[program]) == []
