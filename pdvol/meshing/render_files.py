"""Surfaces that are drawn and not simulated, from files: polygons, texture coordinates and the picture of a texture.

They need not be closed, may have seams, loose vertices and parts that cross: nothing is mended or left out, and
vertices keep the order of the file.
"""

import re
from functools import partial
from pathlib import Path, PureWindowsPath

import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.meshes import RenderSurface, Solid, Surface
from pdvol.meshing.file_kinds import START
from pdvol.meshing.losses import counted
from pdvol.meshing.readers import read_in_child_process, read_with_notes
from pdvol.meshing.surface_files import SURFACES, ObjText, first_that_reads, parse_obj

PICTURES = (".png", ".jpg", ".jpeg")
"""Kinds of textures: what all importers of USD and OBJ read."""
_OPTIONS = re.compile(r"(-(mm +\S+ +\S+|[ost]( +[-+.\d]+){1,3}|[a-z]+ +\S+) +)+")
"""What stands between `map_Kd` and the name of a file."""


def read_render_surface(
    shape: str | Path | RenderSurface | Surface, name: str, material: str = ""
) -> tuple[RenderSurface, list[str], list[str]]:
    """A surface with its texture coordinates; the pictures that the file's materials name; and what of its materials is
    missing or not read, in lines. `shape` and `material` are those of a `RenderMesh`; `name` begins the messages about
    arrays.

    It raises InputError where the file is missing, of an unknown kind, or holds no surface; MeshError where it cannot
    be read, or its faces use vertices or texture coordinates that there are not.
    """
    pictures, lost, path = list[str](), list[str](), Path()
    if isinstance(shape, RenderSurface):
        surface = shape
    elif isinstance(shape, Surface):
        surface = RenderSurface.of(shape.vertices, shape.triangles)
    else:
        path = Path(shape).expanduser()
        name = str(path)
        if path.suffix.lower() == ".obj" and path.is_file() and path.stat().st_size:
            parsed = partial(_parsed, material=material)
            surface, pictures, lost = read_in_child_process(path, first_that_reads, parsed)
        elif path.suffix.lower() not in SURFACES:
            raise InputError(f"{path}: a render mesh is a surface; give one of {', '.join(SURFACES)}")
        else:
            read, lost = read_with_notes(path, weld=False)[0], _lost_of_ply(path)
            if isinstance(read, Solid) or not isinstance(read, Surface):
                raise InputError(f"{path}: a render mesh is a surface, not a {type(read).__name__.lower()}")
            surface = RenderSurface.of(read.vertices, read.triangles)
    if material and path.suffix.lower() != ".obj":
        raise InputError(f"{name}: material={material!r} chooses faces of an OBJ file; leave it out")
    _check(surface, name)
    return surface, pictures, lost


def read_texture(texture: str | Path, name: str) -> tuple[bytes, str]:
    """The bytes of a picture and the ending of its name. It raises InputError where it is missing, unreadable or no
    picture of `PICTURES`.
    """
    path = Path(texture).expanduser()
    ending = path.suffix.lower()
    if ending not in PICTURES:
        raise InputError(f"{name}: the texture {path} is none of {', '.join(PICTURES)}; convert it")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{name}: the texture {path} cannot be read ({error.strerror}); check the path") from error
    if not data.startswith(b"\x89PNG" if ending == ".png" else b"\xff\xd8"):
        raise InputError(f"{name}: the texture {path} is no {ending} picture; save it again")
    return data, ending


def _lost_of_ply(path: Path) -> list[str]:
    """What a PLY file's header promises, and render meshes take from OBJ files alone."""
    head = path.read_bytes()[:START].partition(b"end_header")[0].decode("latin1")
    promised = r"^comment TextureFile (.*\S)|^property .*\b(texcoord|s|u|texture_u|red)\s*$"
    found = re.findall(promised, head, re.MULTILINE) if path.suffix.lower() == ".ply" else []
    names = [file or ("colours" if name == "red" else "texture coordinates") for file, name in found]
    return counted(f"{path}: of a PLY file not read, export OBJ", names)


def _parsed(path: Path, material: str) -> tuple[RenderSurface, list[str], list[str]]:
    """The surface of an OBJ file, or of one of its materials; its pictures and what is lost."""
    found = parse_obj(path)
    if material:
        _keep(path, found, material)
    textured = any(any(words) for words, _ in found.textures)
    uvs = [(float(words[0]), float(words[1])) for words in found.uvs] if textured else []
    bare = len(uvs)  # corners without a place in the texture get its corner, (0, 0)
    uv_corners = [
        _place(int(word), before, bare) if word else bare
        for words, before in (found.textures if textured else ())
        for word in words
    ]
    if textured and not all(all(words) for words, _ in found.textures):
        uvs.append((0.0, 0.0))
    surface = RenderSurface(
        np.array(found.points, dtype=np.float64).reshape(-1, 3),
        np.array([len(face) for face in found.faces], dtype=np.int64),
        np.array([i for face in found.faces for i in face], dtype=np.int64),
        np.array(uvs, dtype=np.float64).reshape(-1, 2),
        np.array(uv_corners, dtype=np.int64),
    )
    return surface, *_pictures(path, found)


def _keep(path: Path, found: ObjText, material: str) -> None:
    """Leaves the faces of a material, and their vertices."""
    chosen = [k for k, one in enumerate(found.materials) if one == material]
    if not chosen:
        there = ", ".join(dict.fromkeys(filter(None, found.materials))) or "none"
        raise MeshError(f"{path}: no face has the material {material!r}; its materials are {there}")
    faces = [found.faces[k] for k in chosen]
    used = {i: number for number, i in enumerate(sorted({i for face in faces for i in face}))}
    if min(used) < 0:
        raise IndexError("a face counts back beyond the first vertex")
    found.points, found.faces = [found.points[i] for i in used], [[used[i] for i in face] for face in faces]
    found.textures, found.materials = [found.textures[k] for k in chosen], [material]


def _place(number: int, before: int, count: int) -> int:
    """A place in the texture, numbered from 0, of its number in a file, which may count backwards."""
    place = number - 1 if number > 0 else before + number
    if not 0 <= place < count:
        raise IndexError(f"a face uses texture coordinate {number}, and there are {count}")
    return place


def _pictures(path: Path, found: ObjText) -> tuple[list[str], list[str]]:
    """The pictures of colour (`map_Kd`) of the materials that a file uses, and a line on what is lost."""
    pictures, missing, others, defined = list[str](), list[str](), list[str](), set[str]()
    used = dict.fromkeys(filter(None, found.materials))
    files = {library: _beside(path.parent, library) for library in found.libraries}
    for file in filter(None, files.values()):
        material = ""
        for line in file.read_text(errors="replace").splitlines():
            word, _, rest = line.strip().partition(" ")
            rest = rest.strip()
            if word == "newmtl":
                material = " ".join(rest.split())
                defined.add(material)
            elif material in used and word.lower() == "map_kd":
                names = rest, _OPTIONS.sub("", rest, count=1)  # the name may have blanks itself
                picture = next(filter(None, (_beside(path.parent, name) for name in names)), None)
                (pictures if picture else missing).append(
                    str(picture or PureWindowsPath(names[1]).name or "map_Kd without a name")
                )
            elif material in used and word.lower().startswith(("map_", "bump", "norm", "disp", "refl")):
                others.append(line.strip())
    absent = counted("files of materials that are missing", [name for name, file in files.items() if file is None])
    absent = absent or counted("materials that no file has", [name for name in used if name not in defined])
    absent += counted("textures that are missing", list(dict.fromkeys(missing)))
    absent += ["put what is missing beside the file, or give RenderMesh(texture=...)"] if absent else []
    lost = [*counted("textures of other kinds left out", others), *absent]
    return list(dict.fromkeys(pictures)), [f"{path}: {'; '.join(lost)}"] if lost else []


def _beside(folder: Path, name: str) -> Path | None:
    """The file that a surface in a folder names: at its place or, where that is one of another machine, in the folder,
    in whatever case. None where there is none.
    """
    place, plain = folder / name.replace("\\", "/"), PureWindowsPath(name).name.lower()
    there = [place, *sorted(file for file in folder.iterdir() if file.name.lower() == plain)]
    return next((file for file in there if file.is_file()), None)


def _check(surface: RenderSurface, name: str) -> None:
    vertices, total = surface.vertices, int(surface.counts.sum()) if len(surface.counts) else 0
    if vertices.ndim != 2 or vertices.shape[1] != 3 or not len(surface.counts):
        raise MeshError(f"{name}: a render mesh needs vertices (n, 3) and faces; export a surface")
    if not np.isfinite(vertices).all() or not np.isfinite(surface.uvs).all():
        raise MeshError(f"{name}: coordinates are not finite numbers; export the mesh again")
    if surface.counts.min() < 3 or total != len(surface.corners):
        raise MeshError(f"{name}: a face of a render mesh needs three corners or more; export the mesh again")
    for what, corners, count in (
        ("vertices", surface.corners, len(vertices)),
        ("texture coordinates", surface.uv_corners, len(surface.uvs)),
    ):
        if len(corners) and (corners.min() < 0 or corners.max() >= count):
            raise MeshError(f"{name}: faces use {what} that there are not ({count:,} there are); export the mesh again")
    if len(surface.uvs) and len(surface.uv_corners) != len(surface.corners):
        raise MeshError(f"{name}: not every corner of a face has a texture coordinate; export the mesh again")
