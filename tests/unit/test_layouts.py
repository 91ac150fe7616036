"""Which files of a folder become objects, and what is said of the others."""

import os

import pytest
from mesh_files import box, put

from stereo_occ.errors import UserError
from stereo_occ.shapes.layouts import UpAxis, list_folder, list_table


def names(listing):
    return [(file.category, file.object_id, file.path.name) for file in listing.files]


def reasons(listing):
    return {entry.object_id: entry.reason for entry in listing.skipped}


def table(root, text):
    path = root / "objects.csv"
    path.write_text(text)
    return path


def test_both_layouts_at_once(tmp_path):
    put(box(1, 1, 1), tmp_path, "mug/folder/model.stl")
    put(box(1, 1, 1), tmp_path, "mug/loose.ply")
    put(box(1, 1, 1), tmp_path, "bowl/alone/scan.off")
    (tmp_path / "mug" / "notes.txt").write_text("not a mesh")
    (tmp_path / "mug" / ".hidden.stl").write_text("not a mesh")
    listing = list_folder(tmp_path)
    assert listing.skipped == []
    assert names(listing) == [
        ("bowl", "alone", "scan.off"), ("mug", "folder", "model.stl"), ("mug", "loose", "loose.ply")
    ]  # fmt: skip
    assert {file.subset for file in listing.files} == {""}


def test_of_several_formats_of_an_object_the_preferred_is_read(tmp_path):
    for place in (
        "mug/a/model.stl",
        "mug/a/model.ply",
        "mug/b.off",
        "mug/b.obj",
        "mug/c/x.glb",
        "mug/c/x.stl",
    ):
        put(box(1, 1, 1), tmp_path, place)
    assert [name for _, _, name in names(list_folder(tmp_path))] == ["model.ply", "x.stl", "b.obj"]


def test_what_cannot_be_told_apart_is_skipped_with_a_remedy(tmp_path):
    put(box(1, 1, 1), tmp_path, "mug/two/body.stl")
    put(box(1, 1, 1), tmp_path, "mug/two/handle.stl")
    put(box(1, 1, 1), tmp_path, "mug/same/model.stl")
    put(box(1, 1, 1), tmp_path, "mug/same.stl")
    (tmp_path / "mug" / "void").mkdir()
    listing = list_folder(tmp_path)
    assert names(listing) == [("mug", "same", "model.stl")]
    found = reasons(listing)
    assert "several meshes (body.stl, handle.stl): call the one to use model.stl" in found["two"]
    assert "put one of .obj" in found["void"]
    assert "called same too" in found["same"]


def test_an_unknown_category_is_skipped_and_the_nearest_one_named(tmp_path):
    put(box(1, 1, 1), tmp_path, "mug/a/model.stl")
    put(box(1, 1, 1), tmp_path, "Bottles/b/model.stl")
    listing = list_folder(tmp_path)
    assert names(listing) == [("mug", "a", "model.stl")]
    (skipped,) = listing.skipped
    assert (skipped.category, skipped.object_id) == ("Bottles", "")
    assert "rename it to bottle" in skipped.reason


def test_a_missing_folder_and_one_without_categories_name_the_folder_and_the_layout(tmp_path):
    with pytest.raises(UserError, match=r"nowhere: no such folder.*CATEGORY/NAME/model"):
        list_folder(tmp_path / "nowhere")
    (tmp_path / "cups").mkdir()
    with pytest.raises(UserError, match=r"holds no category \(cups\).*CATEGORY/NAME/model"):
        list_folder(tmp_path)


def test_a_table_maps_files_to_categories(tmp_path):
    for place in ("a/model.stl", "b.ply", "deep/er/thing.obj"):
        put(box(1, 1, 1), tmp_path, place)
    rows = (
        "File, category ,name,licence\na/model.stl,mug,,CC0\nb.ply, bowl ,salad,\ndeep/er/thing.obj,mug,,\n"
    )
    listing = list_table(tmp_path, table(tmp_path, "\ufeff" + rows))
    assert names(listing) == [
        ("bowl", "salad", "b.ply"),
        ("mug", "a", "model.stl"),
        ("mug", "thing", "thing.obj"),
    ]


def test_a_table_may_divide_the_objects(tmp_path):
    rows = "file,category,subset\n"
    for name, subset in (("a", "train"), ("b", "val"), ("c", "test"), ("d", "")):
        put(box(1, 1, 1), tmp_path, f"{name}.stl")
        rows += f"{name}.stl,mug,{subset}\n"
    listing = list_table(tmp_path, table(tmp_path, rows))
    assert {file.object_id: file.subset for file in listing.files} == {"a": "train", "b": "val", "c": "test"}
    assert reasons(listing) == {"d": "is in no subset"}


def test_a_table_may_say_which_axis_is_up(tmp_path):
    rows = "file,category,up\n"
    for name, axis in (("a", "z"), ("b", "y"), ("c", "")):
        put(box(1, 1, 1), tmp_path, f"{name}.stl")
        rows += f"{name}.stl,mug,{axis}\n"
    for up in UpAxis:
        listing = list_table(tmp_path, table(tmp_path, rows), up)
        assert [file.up for file in listing.files] == [UpAxis.z, UpAxis.y, up]


def test_rows_that_give_no_object_are_skipped(tmp_path):
    put(box(1, 1, 1), tmp_path, "a.stl")
    (tmp_path / "a.txt").write_text("not a mesh")
    rows = "file,category,name\na.stl,mug,\nb.stl,mug,\na.txt,mug,text\na.stl,vase,\n"
    listing = list_table(tmp_path, table(tmp_path, rows))
    assert names(listing) == [("mug", "a", "a.stl")]
    assert {(entry.category, entry.object_id): entry.reason[:14] for entry in listing.skipped} == {
        ("mug", "b"): "does not exist", ("mug", "text"): "is no mesh fil", ("vase", "a"): "'vase' is not "
    }  # fmt: skip


@pytest.mark.parametrize("file", ["../secret.obj", "/etc/secret.obj", "a/../../secret.obj", "", "a\0.obj"])
def test_a_table_cannot_lead_out_of_the_folder(tmp_path, file):
    with pytest.raises(
        UserError, match=r"objects.csv, row 2: file=.* must be a path below data.root, without"
    ):
        list_table(tmp_path, table(tmp_path, f"file,category\n{file},mug\n"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "path;category\na.stl;mug\n",
            "no column file and no category but path;category; its columns are file",
        ),
        ("", "no column file and no category but none"),
        ("file,category\na.stl,mug\nb/a.stl,mug\n", "row 3: mug/a is a.stl already"),
        (
            "file,category,subset\na.stl,mug,training\n",
            "row 2: subset='training' must be one of train, val, test",
        ),
        ("file,category,up\na.stl,mug,x\n", "row 2: up='x' must be y or z, or empty"),
        ("file,category,name\na.stl,mug,../b\n", r"row 2: name '\.\./b' cannot be part of a file name"),
        ("file,category,name\na.stl,mug,.b\n", r"row 2: name '\.b' cannot be"),
    ],
)
def test_mistakes_in_a_table_are_one_line(tmp_path, text, message):
    with pytest.raises(UserError, match=message) as caught:
        list_table(tmp_path, table(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_a_table_that_cannot_be_read(tmp_path):
    with pytest.raises(UserError, match=r"data.table=.*nowhere.csv: cannot be read"):
        list_table(tmp_path, tmp_path / "nowhere.csv")
    (tmp_path / "noise.csv").write_bytes(bytes(range(256)))
    with pytest.raises(UserError, match=r"data.table=.*noise.csv: "):
        list_table(tmp_path, tmp_path / "noise.csv")


@pytest.mark.parametrize(("name", "shown"), [(b"a\xff.obj", r"a\udcff.obj"), (b"a\nb.obj", r"a\nb.obj")])
def test_a_name_that_cannot_be_written_down_is_left_out(tmp_path, name, shown):
    (tmp_path / "mug").mkdir()
    (tmp_path / "mug" / os.fsdecode(name)).touch()
    (tmp_path / os.fsdecode(name)).mkdir()
    listing = list_folder(tmp_path)
    assert listing.files == []
    assert sorted(file.path.name for file in listing.skipped) == [shown] * 2
    assert all(str(file.path).isprintable() and file.reason.isprintable() for file in listing.skipped)
