#!/bin/sh
# trimesh 5.2.0 with numpy 2.4.6: copy() of a mesh with vertex normals of its own has other normals.
#
# Guess: a copy of a mesh equals the mesh, with the vertex normals that Trimesh() was given.
# Seen:  copy() leaves them out and the copy computes normals from its faces, without a word. They also go when the
#        vertices are edited in place, while apply_transform(), apply_scale() and concatenate() keep them, so the
#        order of the steps decides which normals a result has. submesh() and subdivide() lose them too.
#        copy(include_cache=True) keeps them. An export of the mesh has the given normals, one of its copy those of
#        the triangles.
# Output:
#   made: the given normals
#   moved: the given normals
#   scaled: the given normals
#   two concatenated: the given normals
#   copied with its cache: the given normals
#   exported: the given normals
#   copied: other normals
#   copied, then exported: other normals
#   vertices += 1: other normals
#   submesh: other normals
#   subdivided: other normals
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check numpy==2.4.6 scipy==1.17.1 trimesh==5.2.0
cd "$work"
"$work/venv/bin/python" - <<'PY'
import sys

import numpy as np
import trimesh

# A sphere whose normals all point along z: none of the faces' normals would be taken for them.
sphere = trimesh.creation.icosphere(1)
own = np.array([0.0, 0.0, 1.0])


def made():
    normals = np.tile(own, (len(sphere.vertices), 1))
    return trimesh.Trimesh(sphere.vertices.copy(), sphere.faces.copy(), vertex_normals=normals, process=False)


def in_place(change):
    mesh = made()
    change(mesh)
    return mesh


def edit(mesh):
    mesh.vertices += 1


def exported(mesh):
    """The normal of the first vertex in the bytes of a PLY file: three floats behind its position."""
    data = mesh.export(file_type="ply", vertex_normal=True)
    body = data[data.index(b"end_header\n") + 11 :]
    return np.frombuffer(body[12:24], "<f4").astype(float)


normals = {
    "made": made().vertex_normals,
    "moved": in_place(lambda mesh: mesh.apply_translation([1, 0, 0])).vertex_normals,
    "scaled": in_place(lambda mesh: mesh.apply_scale(2)).vertex_normals,
    "two concatenated": trimesh.util.concatenate([made(), made()]).vertex_normals,
    "copied with its cache": made().copy(include_cache=True).vertex_normals,
    "exported": exported(made()),
    "copied": made().copy().vertex_normals,
    "copied, then exported": exported(made().copy()),
    "vertices += 1": in_place(edit).vertex_normals,
    "submesh": made().submesh([range(40)], append=True).vertex_normals,
    "subdivided": made().subdivide().vertex_normals,
}
kept = {name: bool(np.abs(got - own).max() < 1e-6) for name, got in normals.items()}
for name, right in kept.items():
    print(f"{name}: {'the given normals' if right else 'other normals'}")
names = list(kept)
if not all(kept[name] for name in names[:6]):
    sys.exit("no longer as written: one of the first six loses the normals")
if any(kept[name] for name in names[6:]):
    sys.exit("no longer as written: one of the last five keeps the normals")
PY
