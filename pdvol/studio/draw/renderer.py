"""Renders levels of 3D scenes, with one camera and one set of lights for a whole picture or film. Needs no display."""

from contextlib import ExitStack
from io import BytesIO
from typing import Any, Self

import numpy as np
import pyvista as pv
from PIL import Image

from pdvol.store.reader import Run, RunLevel
from pdvol.store.render_meshes import StoredRender
from pdvol.studio.draw.camera import Camera
from pdvol.studio.draw.contact_shadows import shadow_map
from pdvol.studio.draw.cut import Cut, skin, triangles
from pdvol.studio.draw.layout import BACKGROUND
from pdvol.studio.shown import CREASE_ANGLE, GROUND, OBSTACLE, PALETTE, SMOOTH_FROM

_MATERIAL = {"ambient": 0.42, "diffuse": 0.8, "specular": 0.14, "specular_power": 18}  # of bodies and obstacles in 3D
_PAINT = {"ambient": 0.62, "diffuse": 0.58, "specular": 0.06}  # of cells with colours: light that spares them


class Window:
    """Renders pictures of one size without a display, inside a `with` block.

    Parameters
    ----------
    camera : of the lights, and of pictures that name no other one
    size : (width, height) of a picture [pixels]
    oversampling : pixels rendered for each pixel of a picture, along each side: smooth edges
    lighting : pyvista's name of a set of lights
    """

    def __init__(self, camera: Camera, size: tuple[int, int], oversampling: int = 2, lighting: str = "none"):
        self.camera, self.size, self.oversampling = camera, size, oversampling
        self._lighting = lighting

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            stack.enter_context(pv.vtk_verbosity("error"))  # without a display VTK prints long warnings
            window, theme = [self.oversampling * n for n in self.size], pv.themes.DocumentTheme()
            self.plotter = pv.Plotter(off_screen=True, window_size=window, lighting=self._lighting, theme=theme)
            stack.callback(self.plotter.close)
            self.plotter.set_background(BACKGROUND)
            self._open = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def add(self, shape: Any, **style: Any) -> None:
        """Add a shape of pyvista; `style` as for its `add_mesh`."""
        self.plotter.add_mesh(shape, reset_camera=False, render=False, **style)

    def image(self, camera: Camera) -> Image.Image:
        """What has been added, seen by a camera."""
        camera.set_up(self.plotter.camera)
        self.plotter.render()
        rendered = Image.fromarray(np.asarray(self.plotter.screenshot(None, return_img=True)))
        return rendered.resize(self.size, Image.Resampling.LANCZOS)


class Renderer(Window):
    """Renders levels of 3D runs.

    Parameters
    ----------
    camera, size, oversampling : as for `Window`
    facets : whether bodies that carry render meshes are drawn by their cells
    cut : takes away a part of the scene
    """

    def __init__(
        self, camera: Camera, size: tuple[int, int], oversampling: int = 2, facets: bool = False, cut: Cut | None = None
    ):
        super().__init__(camera, size, oversampling)
        self._facets, self._cut, self._view = facets, cut, camera
        self._textures: dict[StoredRender, pv.Texture | None] = {}
        self._pictures: dict[bytes, pv.Texture | None] = {}  # by content: runs of a scene share a picture

    def __enter__(self) -> Self:
        super().__enter__()
        camera = self.camera
        camera.set_up(self.plotter.camera)
        # The directions the three lights come from: a warm main light, a cool one from the right, one from behind.
        self._light = 0.75 * camera.up - 0.42 * camera.right + 0.5 * camera.towards
        for direction, colour, power in (
            (self._light, "#fff6ea", 0.74),
            (0.9 * camera.right + 0.1 * camera.up + 0.5 * camera.towards, "#dfeaff", 0.34),
            (camera.up - 0.6 * camera.towards, "#ffffff", 0.3),
        ):
            place = {"position": camera.focus + direction, "focal_point": camera.focus}
            self.plotter.add_light(pv.Light(**place, color=colour, intensity=power))
        self.plotter.enable_ssao(radius=0.06 * camera.size, bias=0.002 * camera.size, kernel_size=48, blur=True)
        return self

    def picture(
        self, run: Run, level: RunLevel, step: int, camera: Camera | None = None, colours: np.ndarray | None = None
    ) -> Image.Image:
        """One level of a run at one step.

        Parameters
        ----------
        camera : instead of the renderer's, in the same direction and of the same aspect
        colours : (m, 3) in [0, 1], of the level's cells; those of bodies when None
        """
        self._view = camera or self.camera
        self.plotter.clear_actors()
        self._draw(run, level, level.positions(step), step, colours)
        return self.image(self._view)

    def _draw(self, run: Run, level: RunLevel, positions: np.ndarray, step: int, colours: np.ndarray | None) -> None:
        names = [str(name) for name in run.info.get("bodies", ())]
        whole = () if self._facets or colours is not None else run.render_meshes
        carried = [mesh for mesh in whole if self._cut_of(names[mesh.body], True) is None]
        owners, drawn = level.mesh.point_bodies[level.surface[:, 0]], [mesh.body for mesh in carried]
        shapes = [positions[level.surface[np.isin(owners, drawn)]]]  # corners (k, 3, 3) [m] of triangles, for shadows
        for mesh in carried:
            self._add_render_mesh(mesh, level.render_weights(mesh) @ positions)
        for body in np.setdiff1d(owners, drawn):
            facets, mine, colour = level.surface[owners == body], level.bodies == body, PALETTE[body % len(PALETTE)]
            cut = self._cut_of(names[body], True)
            smooth = len(facets) >= SMOOTH_FROM
            edges = float(np.clip(12.0 / np.sqrt(len(facets)), 0.15, 0.5))  # many edges must not blacken the body
            points = positions
            if cut or colours is not None:
                solid: Any = pv.UnstructuredGrid({pv.CellType.TETRA: level.cells[mine]}, positions)
                if colours is not None:
                    solid.cell_data["colour"] = np.round(255 * colours).astype(np.uint8)[mine]
                left = cut.left(solid, self._view.towards) if cut else skin(solid)
                points, facets = triangles(left)
            if colours is None:
                self._add_surface(points, facets, pv.Color(colour), smooth, edges)
            elif len(facets):
                self.add(left, scalars="colour", rgb=True, smooth_shading=False, **_PAINT)
            shapes.append(points[facets])
        obstacles = level.placed(run.obstacles, step)
        for obstacle in obstacles:
            if obstacle.kind == "mesh":
                points, faces = obstacle.vertices(step), obstacle.arrays["faces"]
                opacity, smooth = float(obstacle.arrays.get("opacity", 1.0)), len(faces) >= 200
                if cut := self._cut_of(obstacle.name, False):
                    surface = pv.PolyData.from_regular_faces(points, faces)
                    points, faces = triangles(cut.left(surface, self._view.towards))
                shapes.append(points[faces])
                self._add_surface(points, faces, pv.Color(OBSTACLE), smooth, 0.0, opacity)
        for obstacle in obstacles:
            if obstacle.kind == "plane":
                self._add_plane(*obstacle.plane(step), np.concatenate(shapes))

    def _cut_of(self, name: str, body: bool) -> Cut | None:
        return self._cut if self._cut is not None and self._cut.through(name, body) else None

    def _add_surface(
        self, points: np.ndarray, facets: np.ndarray, colour: pv.Color, smooth: bool, edges: float, opacity: float = 1.0
    ) -> None:
        if len(facets) == 0:
            return
        used, local = np.unique(facets, return_inverse=True)
        surface = pv.PolyData.from_regular_faces(points[used], local.reshape(facets.shape))
        style: dict[str, Any] = {**_MATERIAL, "smooth_shading": smooth}
        if smooth:
            style |= {"split_sharp_edges": True, "feature_angle": CREASE_ANGLE}
        if edges:
            darker = pv.Color([0.45 * c for c in colour.float_rgb])
            style |= {"show_edges": True, "edge_color": darker, "edge_opacity": edges}
            style["line_width"] = self.oversampling * 0.5
        self.add(surface, color=colour, opacity=opacity, **style)

    def _add_render_mesh(self, mesh: StoredRender, points: np.ndarray) -> None:
        """Add a render mesh with vertices at `points` (n, 3) [m]. Normals are smooth across seams, places in the
        texture are not: each corner of a triangle is a point.
        """
        if mesh not in self._textures:
            content = b"" if mesh.texture is None else mesh.texture.read_bytes()
            if content not in self._pictures:
                self._pictures[content] = _texture_of(content)
            self._textures[mesh] = self._pictures[content]
        smooth = pv.PolyData.from_regular_faces(points, mesh.welded)
        smooth = smooth.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False)
        corners = mesh.fans.ravel()
        split = pv.PolyData.from_regular_faces(points[mesh.corners[corners]], np.arange(len(corners)).reshape(-1, 3))
        split.point_data["Normals"] = np.asarray(smooth.point_data["Normals"])[mesh.first[mesh.corners[corners]]]
        split.point_data.active_normals_name = "Normals"
        if len(mesh.uvs):
            split.active_texture_coordinates = mesh.uvs[mesh.uv_corners[corners]]
        texture = self._textures[mesh]
        colour = None if texture else pv.Color(PALETTE[mesh.body % len(PALETTE)])
        self.add(split, color=colour, texture=texture, smooth_shading=True, **_MATERIAL)

    def _add_plane(self, point: np.ndarray, normal: np.ndarray, shapes: np.ndarray) -> None:
        camera = self._view
        if (camera.position - point) @ normal <= 0:
            return  # from behind the plane would hide the scene
        e0 = np.cross(camera.up if abs(normal @ camera.up) < 0.95 else camera.towards, normal)
        e0 /= np.linalg.norm(e0)
        e1 = np.cross(normal, e0)
        centre = camera.focus - ((camera.focus - point) @ normal) * normal
        local = (shapes - centre) @ np.column_stack([e0, e1, normal])
        light = np.array([self._light @ e0, self._light @ e1]) / max(
            self._light @ normal, 0.5 * np.linalg.norm(self._light)
        )
        local[..., :2] -= local[..., 2:] * light
        half, pixels = 1.7 * camera.size, 400
        texture = _ground(1.0 - shadow_map(local, camera.size, half, pixels))
        quad = pv.PolyData(centre + half * np.array([-e0 - e1, e0 - e1, e0 + e1, -e0 + e1]), faces=[4, 0, 1, 2, 3])
        quad.active_texture_coordinates = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
        # The first row of an image is its top.
        image = pv.Texture(np.ascontiguousarray(texture[::-1]))
        image.interpolate = True
        self.add(quad, texture=image, lighting=False)


def _ground(lit: np.ndarray) -> np.ndarray:
    """The ground's texture (n, n, 3) uint8: its lit colour, fading into the background with the distance."""
    n = len(lit)
    r = np.linalg.norm((np.indices((n, n)) + 0.5) / n * 2 - 1, axis=0)
    fade = np.clip((r - 0.2) / 0.75, 0, 1)
    fade = (fade * fade * (3 - 2 * fade))[..., None]
    colour = (1 - fade) * pv.Color(GROUND).float_rgb + fade * np.array(pv.Color(BACKGROUND).float_rgb)
    tint = 1 - (1 - lit[..., None]) * np.array([1.0, 0.97, 0.9])  # shadows are a little blue
    return np.round(255 * colour * tint).astype(np.uint8)


def _texture_of(content: bytes) -> pv.Texture | None:
    """A texture of what a picture's file holds; None for an empty file."""
    if not content:
        return None
    with Image.open(BytesIO(content)) as picture:
        texture = pv.Texture(np.asarray(picture.convert("RGB")))
    texture.interpolate, texture.repeat = True, True
    return texture
