"""Sources and results in an S3 store that fails now and then; archives."""

import json
import logging
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("distributed")
pytest.importorskip("s3fs")
pytest.importorskip("moto.server")

import circparam
from circparam.batch import store
from circparam.batch.batch import run_batch, status
from circparam.batch.cluster import Cluster
from circparam.batch.manifest import journal, read_lines
from circparam.batch.run import BatchPlan
from circparam.batch.sources import Listing
from circparam.batch.store import Folder
from circparam.batch.task import fetch
from circparam.errors import InputError, OutputError
from tests.support.batch_faults import QUICK, settings, write_set
from tests.support.s3_server import Failing, s3_server


@pytest.fixture
def s3(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[tuple[Any, Failing]]:
    import s3fs

    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    s3fs.S3FileSystem.clear_instance_cache()
    with s3_server(monkeypatch, every=10) as server:
        system = s3fs.S3FileSystem(use_listings_cache=False)
        store.again(system.mkdir, "bucket")
        yield system, server
    s3fs.S3FileSystem.clear_instance_cache()


def test_a_batch_from_s3_to_s3(s3, tmp_path, request):
    system, server = s3
    source = write_set(tmp_path / "src", 3)
    store.again(system.put, str(source) + "/", "bucket/in/", recursive=True)
    given = settings("s3://bucket/out")
    cluster = Cluster(workers=1)  # not the shared one: it must know the environment of the store
    request.addfinalizer(cluster.kill)
    address = cluster.client.scheduler.address
    summary = run_batch(BatchPlan(["s3://bucket/in"], given, scheduler=address))
    assert summary.counts == {"ok": 3}
    assert server.failed >= 3
    found = sorted(store.again(system.find, "bucket/out"))
    names = sorted(str(p.relative_to(source)) for p in source.rglob("*.obj"))
    expected = [f"bucket/out/{n}" for n in (*names, "manifest.jsonl", "report.csv", "report.html")]
    assert found == sorted(expected)
    for name in names:
        circparam.unwrap(str(source / name), str(tmp_path / "one.obj"), overwrite=True, **QUICK)
        assert (
            store.again(system.cat_file, f"bucket/out/{name}")
            == (tmp_path / "one.obj").read_bytes()
        )
    told = list(read_lines(journal(Folder("s3://bucket/out"))))
    assert sorted(line["name"] for line in told) == names
    assert all(line["source_hash"].startswith("etag:") for line in told)
    assert all(line["source"].startswith("s3://bucket/in/") for line in told)
    assert status("s3://bucket/out")["counts"] == {"ok": 3}

    # continued, from another machine as well: nothing to do until a source has changed
    journal(Folder("s3://bucket/out")).unlink()
    again = run_batch(BatchPlan(["s3://bucket/in"], given, scheduler=address))
    assert (again.done, again.skipped) == (0, 3)
    store.again(system.pipe_file, f"bucket/in/{names[0]}", (source / names[1]).read_bytes())
    changed = run_batch(BatchPlan(["s3://bucket/in/**/*.obj"], given, scheduler=address))
    assert (changed.done, changed.skipped) == (1, 2)


def test_a_glob_of_a_store_and_what_is_missing(s3: tuple[Any, Failing], tmp_path: Path) -> None:
    system, _ = s3
    store.again(system.put, str(write_set(tmp_path / "src", 4)) + "/", "bucket/in/", recursive=True)
    found = {s.name for s in Listing(["s3://bucket/in/a/*.obj"])}
    assert found == {"m001.obj", "m003.obj"}
    assert [s.name for s in Listing(["s3://bucket/in/a/m001.obj"])] == ["m001.obj"]
    (tmp_path / "l").write_text("s3://bucket/in/a/m001.obj\n")
    assert [s.name for s in Listing([f"@{tmp_path / 'l'}"])] == ["bucket/in/a/m001.obj"]
    for address in ("s3://bucket/none", "s3://nobucket/x.obj", "s3://bucket/in/*.glb"):
        with pytest.raises(InputError, match=r"no such file|cannot be listed|no mesh file"):
            list(Listing([address]))


TREE = {"buffers": [{"uri": "sub/b.bin"}, {"uri": "data:,x"}], "images": [{"uri": "i.png"}]}
# name of a mesh → the files in the store, and which come along: always, and with --copy-assets
BESIDE: dict[str, tuple[dict[str, bytes], set[str], set[str]]] = {
    "m.gltf": (
        {"m.gltf": json.dumps(TREE).encode(), "sub/b.bin": b"b", "i.png": b"i"}, {"b.bin"}, {"i.png"}
    ),
    "in/m.obj": (
        {
            "in/m.obj": b"mtllib mat\\m.mtl\nv 0 0 0\n",
            "in/mat/m.mtl": b"newmtl a\nmap_Kd -s 2 2 2 old wood.png\nmap_Bump tex\\bump.png\n",
            "in/wood.png": b"w",
            "in/tex/bump.png": b"b",
        },
        set(), {"m.mtl", "wood.png", "bump.png"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BESIDE)
def test_files_that_a_mesh_names_come_along(name: str, s3: Any, tmp_path: Path) -> None:
    held, always, copied = BESIDE[name]
    for other, data in held.items():
        store.again(s3[0].pipe_file, f"bucket/{other}", data)
    for asked in (False, True):
        folder = tmp_path / str(asked)
        given = settings("o", copy_assets=asked)
        path, digest = fetch(f"s3://bucket/{name}", str(folder), given)
        assert digest is not None
        found = {p.name for p in folder.rglob("*") if p.is_file()}
        assert found == {Path(path).name, *always, *(copied if asked else ())}
        assert Path(path).name == Path(name).name


def test_an_upload_that_never_succeeds_is_told(s3, tmp_path, monkeypatch):
    from circparam.batch.manifest import Manifest

    manifest = Manifest(Folder("s3://bucket/out"))
    manifest.append({"name": "a"})
    monkeypatch.setattr(store, "CALL_TRIES", 2)
    monkeypatch.setattr(store, "FIRST_PAUSE_SECONDS", 0.0)
    s3[1].every = 1
    with pytest.raises(
        OutputError, match=r"s3://bucket/out/manifest.jsonl: .* its lines are kept in"
    ):
        manifest.close()
    s3[1].every = 0
    kept = Manifest(Folder("s3://bucket/out"))
    assert [line["name"] for line in read_lines(kept.path)] == ["a"]
    kept.close()
    assert b'"a"' in s3[0].cat_file("bucket/out/manifest.jsonl")


def test_meshes_in_an_archive(shared: str, tmp_path: Path) -> None:
    source = write_set(tmp_path / "src", 2)
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for path in source.rglob("*.obj"):
            archive.write(path, path.relative_to(source))
    out = tmp_path / "out"
    given = settings(out)
    address = f"zip://{tmp_path / 'a.zip'}::**/*.obj"
    assert run_batch(BatchPlan([address], given, scheduler=shared)).counts == {"ok": 2}
    for path in source.rglob("*.obj"):
        circparam.unwrap(str(path), str(tmp_path / "one.obj"), overwrite=True, **QUICK)
        assert (out / path.relative_to(source)).read_bytes() == (tmp_path / "one.obj").read_bytes()
