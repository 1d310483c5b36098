"""Renders levels at steps, with one camera and one set of lights for a whole picture or film. Needs no display."""

from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import lazy_loader
import numpy as np
from PIL import Image, ImageDraw

from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel
from pdvol.store.render_meshes import StoredRender
from pdvol.store.series import in_3d
from pdvol.studio.draw.camera import Camera
from pdvol.studio.draw.contact_shadows import shadow_map
from pdvol.studio.draw.cut import Cut
from pdvol.studio.draw.layout import BACKGROUND, FAINT_INK, font
from pdvol.studio.shown import CREASE_ANGLE, GROUND, OBSTACLE, PALETTE, SMOOTH_FROM, closed_loops

if TYPE_CHECKING:
    import pyvista as pv
else:
    pv = lazy_loader.load("pyvista")  # takes two seconds, and `from pdvol import *` draws nothing

_MATERIAL = {"ambient": 0.42, "diffuse": 0.8, "specular": 0.14, "specular_power": 18}  # of bodies and obstacles in 3D


class Renderer:
    """Renders pictures of one size, inside a `with` block.

    Parameters
    ----------
    run : Run
    camera : Camera
        Of every picture that names no other one, and of the lights.
    width : of a picture [pixels]; the height follows from the camera
    obstacles : drawn beside the bodies
    oversampling : pixels rendered for each pixel of a picture, along each side: smooth edges
    render_meshes : whether bodies that carry render meshes are drawn as these
    cut : takes away a part of 3D scenes

    Attributes
    ----------
    size : (width, height) of a picture [pixels]
    """

    def __init__(
        self,
        run: Run,
        camera: Camera,
        width: int,
        obstacles: Sequence[DrawnObstacle],
        oversampling: int = 2,
        render_meshes: bool = False,
        cut: Cut | None = None,
    ):
        self._carried = {mesh: _texture_of(mesh) for mesh in (run.render_meshes if render_meshes else ())}
        self.run, self.camera, self.obstacles, self._cut = run, camera, tuple(obstacles), cut
        self.size = (width, max(2, round(width / camera.aspect)))
        self.oversampling = oversampling
        self._dim = run.levels[0].rest.shape[1]
        self._view = camera
        self._drawn: tuple = ()

    def picture(self, level: RunLevel, step: int, camera: Camera | None = None) -> Image.Image:
        """One level at one step; where the step is not simulated yet, a picture with a note.

        Parameters
        ----------
        camera : instead of the renderer's own, of the same aspect
        """
        if step >= level.steps:
            image = Image.new("RGB", self.size, BACKGROUND)
            middle = (self.size[0] / 2, self.size[1] / 2)
            ImageDraw.Draw(image).text(middle, "not simulated yet", FAINT_INK, font(15), anchor="mm")
            return image
        self._view = self.camera if camera is None else camera
        self._view.set_up(self._plotter.camera, parallel=self._dim == 2)
        drawn = (level, step, *self._view.focus, self._view.distance)
        if drawn != self._drawn:
            self._plotter.clear_actors()
            positions = in_3d(level.positions(step))
            (self._draw_flat if self._dim == 2 else self._draw_solid)(level, positions, step)
            self._drawn = drawn
        self._plotter.render()
        rendered = Image.fromarray(np.asarray(self._plotter.screenshot(None, return_img=True)))
        return rendered.resize(self.size, Image.Resampling.LANCZOS)

    def __enter__(self) -> "Renderer":
        with ExitStack() as stack:
            stack.enter_context(pv.vtk_verbosity("error"))  # without a display VTK prints long warnings
            window = [self.oversampling * n for n in self.size]
            self._plotter = pv.Plotter(
                off_screen=True, window_size=window, lighting="none", theme=pv.themes.DocumentTheme()
            )
            stack.callback(self._plotter.close)
            self._setup()
            self._open = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def _setup(self) -> None:
        camera, plotter = self.camera, self._plotter
        plotter.set_background(BACKGROUND)
        camera.set_up(plotter.camera, parallel=self._dim == 2)
        if self._dim == 3:
            # The directions the three lights come from: a warm main light, a cool one from the right, one from behind.
            self._light = 0.75 * camera.up - 0.42 * camera.right + 0.5 * camera.towards
            for direction, colour, power in (
                (self._light, "#fff6ea", 0.74),
                (0.9 * camera.right + 0.1 * camera.up + 0.5 * camera.towards, "#dfeaff", 0.34),
                (camera.up - 0.6 * camera.towards, "#ffffff", 0.3),
            ):
                plotter.add_light(
                    pv.Light(position=camera.focus + direction, focal_point=camera.focus, color=colour, intensity=power)
                )
            plotter.enable_ssao(radius=0.06 * camera.size, bias=0.002 * camera.size, kernel_size=48, blur=True)

    def _width(self, pixels: float) -> float:
        """A line's width in the pixels of the finished picture."""
        return self.oversampling * pixels

    # ---- 3D

    def _draw_solid(self, level: RunLevel, positions: np.ndarray, step: int) -> None:
        facets, owners = level.surface, level.mesh.point_bodies[level.surface[:, 0]]
        carried = [mesh.body for mesh in self._carried]
        shapes = [positions[facets[np.isin(owners, carried)]]]
        for mesh, texture in self._carried.items():
            self._add_render_mesh(mesh, texture, level.render_weights(mesh) @ positions)
        shapes += [self.draw_body(level, int(body), positions, step) for body in np.setdiff1d(owners, carried)]
        for obstacle in level.placed(self.obstacles, step):
            if obstacle.kind == "mesh":
                opacity = float(obstacle.arrays.get("opacity", 1.0))
                vertices, faces = obstacle.vertices(step), obstacle.arrays["faces"]
                if self._cut is not None and self._cut.through(str(obstacle.name), False):
                    vertices, faces = self._cut.surface(vertices, faces, self._view.towards)
                shapes.append(vertices[faces])
                self._add_surface(vertices, faces, pv.Color(OBSTACLE), len(faces) >= 200, 0.0, opacity)
        for obstacle in level.placed(self.obstacles, step):
            if obstacle.kind == "plane":
                self._add_plane(*obstacle.plane(step), np.concatenate(shapes))

    def draw_body(self, level: RunLevel, body: int, positions: np.ndarray, step: int) -> np.ndarray:
        """Draw a body of a 3D scene in its colour; gives the corners (k, 3, 3) [m] of its triangles, for shadows.

        Parameters
        ----------
        positions : (n, 3) [m], of all vertices of the level at `step`
        """
        mine = level.surface[level.mesh.point_bodies[level.surface[:, 0]] == body]
        colour = pv.Color(PALETTE[body % len(PALETTE)])
        edges = float(np.clip(12.0 / np.sqrt(len(mine)), 0.15, 0.5))  # many edges must not blacken the body
        points, smooth = positions, len(mine) >= SMOOTH_FROM
        if self._cut is not None and self._cut.through(str(self.run.info["bodies"][body]), True):
            points, mine = self._cut.solid(positions, level.cells[level.bodies == body], self._view.towards)
        self._add_surface(points, mine, colour, smooth, edges)
        return points[mine]

    def _add_surface(
        self,
        points: np.ndarray,
        facets: np.ndarray,
        colour: "pv.Color",
        smooth: bool,
        edges: float,
        opacity: float = 1.0,
    ) -> None:
        if len(facets) == 0:
            return
        used, local = np.unique(facets, return_inverse=True)
        surface = pv.PolyData.from_regular_faces(points[used], local.reshape(facets.shape))
        style: dict[str, Any] = {**_MATERIAL, "smooth_shading": smooth}
        if smooth:
            style |= {"split_sharp_edges": True, "feature_angle": CREASE_ANGLE}
        if edges:
            style |= {"show_edges": True, "edge_color": _darker(colour, 0.45), "edge_opacity": edges}
            style["line_width"] = self._width(0.5)
        self._plotter.add_mesh(surface, color=colour, opacity=opacity, **style, reset_camera=False, render=False)

    def _add_render_mesh(self, mesh: StoredRender, texture: "pv.Texture | None", points: np.ndarray) -> None:
        colour = None if texture else pv.Color(PALETTE[mesh.body % len(PALETTE)])
        self._plotter.add_mesh(
            _drawn_mesh(mesh, points),
            color=colour,
            texture=texture,
            smooth_shading=True,
            **_MATERIAL,
            reset_camera=False,
            render=False,
        )

    def _add_plane(self, point: np.ndarray, normal: np.ndarray, triangles: np.ndarray) -> None:
        camera = self._view
        if (camera.position - point) @ normal <= 0:
            return  # from behind the plane would hide the scene
        e0 = np.cross(camera.up if abs(normal @ camera.up) < 0.95 else camera.towards, normal)
        e0 /= np.linalg.norm(e0)
        e1 = np.cross(normal, e0)
        centre = camera.focus - ((camera.focus - point) @ normal) * normal
        local = (triangles - centre) @ np.column_stack([e0, e1, normal])
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
        self._plotter.add_mesh(quad, texture=image, lighting=False, reset_camera=False, render=False)

    # ---- 2D

    def _draw_flat(self, level: RunLevel, positions: np.ndarray, step: int) -> None:
        coarseness = float(np.clip(14.0 / np.sqrt(len(level.cells)), 0.2, 1.0))
        for body in np.unique(level.bodies):
            colour = pv.Color(PALETTE[body % len(PALETTE)])
            mine = level.cells[level.bodies == body]
            ink, width = _darker(colour, 0.8 - 0.2 * coarseness), self._width(0.5 + 0.7 * coarseness)
            self._fill(positions, mine, colour, 0.0, show_edges=True, edge_color=ink, line_width=width)
            outline = level.surface[level.mesh.point_bodies[level.surface[:, 0]] == body]
            self._lines(positions, outline, _darker(colour, 0.5), 2.0)
        for obstacle in level.placed(self.obstacles, step):
            if obstacle.kind == "plane":
                self._add_half_space(*(in_3d(v[None])[0] for v in obstacle.plane(step)))
            elif obstacle.kind == "polyline":
                vertices, edges = in_3d(obstacle.vertices(step)), obstacle.arrays["edges"]
                for loop in closed_loops(edges):
                    polygon = pv.PolyData(vertices[loop], faces=[len(loop), *range(len(loop))]).triangulate()
                    self._fill(np.asarray(polygon.points), polygon.regular_faces, pv.Color(OBSTACLE), -0.1)
                self._lines(vertices, edges, _darker(pv.Color(OBSTACLE), 0.55), 2.5)

    def _fill(self, points: np.ndarray, triangles: np.ndarray, colour: "pv.Color", depth: float, **edges: Any) -> None:
        surface = pv.PolyData.from_regular_faces(points + [0, 0, depth * self._view.size], triangles)
        self._plotter.add_mesh(surface, color=colour, lighting=False, reset_camera=False, render=False, **edges)

    def _lines(self, points: np.ndarray, segments: np.ndarray, colour: "pv.Color", width: float) -> None:
        raised = points + [0, 0, 0.05 * self._view.size]
        lines = pv.PolyData(raised, lines=np.insert(segments, 0, 2, axis=1).ravel())
        self._plotter.add_mesh(
            lines, color=colour, line_width=self._width(width), lighting=False, reset_camera=False, render=False
        )

    def _add_half_space(self, point: np.ndarray, normal: np.ndarray) -> None:
        along = np.array([-normal[1], normal[0], 0.0])
        middle = point + ((self._view.focus - point) @ along) * along
        reach = 4 * self._view.size
        corners = middle + np.array(
            [-reach * along, reach * along, reach * along - reach * normal, -reach * along - reach * normal]
        )
        self._fill(corners, np.array([[0, 1, 2], [0, 2, 3]]), pv.Color(GROUND), -0.2)
        self._lines(corners[:2], np.array([[0, 1]]), _darker(pv.Color(GROUND), 0.7), 2.0)


def _darker(colour: "pv.Color", factor: float) -> "pv.Color":
    return pv.Color([factor * c for c in colour.float_rgb])


def _ground(lit: np.ndarray) -> np.ndarray:
    """The ground's texture (n, n, 3) uint8: its lit colour, fading into the background with the distance."""
    n = len(lit)
    r = np.linalg.norm((np.indices((n, n)) + 0.5) / n * 2 - 1, axis=0)
    fade = np.clip((r - 0.2) / 0.75, 0, 1)
    fade = (fade * fade * (3 - 2 * fade))[..., None]
    colour = (1 - fade) * pv.Color(GROUND).float_rgb + fade * np.array(pv.Color(BACKGROUND).float_rgb)
    tint = 1 - (1 - lit[..., None]) * np.array([1.0, 0.97, 0.9])  # shadows are a little blue
    return np.round(255 * colour * tint).astype(np.uint8)


def _drawn_mesh(mesh: StoredRender, points: np.ndarray) -> "pv.PolyData":
    """A render mesh: its triangles with vertices at `points` (n, 3) [m], each corner for itself. Normals are smooth
    across seams, places in the texture are not.
    """
    smooth = pv.PolyData.from_regular_faces(points, mesh.welded)
    smooth = smooth.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False)
    corners = mesh.fans.ravel()
    split = pv.PolyData.from_regular_faces(points[mesh.corners[corners]], np.arange(len(corners)).reshape(-1, 3))
    split.point_data["Normals"] = np.asarray(smooth.point_data["Normals"])[mesh.first[mesh.corners[corners]]]
    split.point_data.active_normals_name = "Normals"
    if len(mesh.uvs):
        split.active_texture_coordinates = mesh.uvs[mesh.uv_corners[corners]]
    return split


def _texture_of(mesh: StoredRender) -> "pv.Texture | None":
    """The picture of a render mesh; None where it has none."""
    if mesh.texture is None:
        return None
    with Image.open(mesh.texture) as picture:
        texture = pv.Texture(np.asarray(picture.convert("RGB")))
    texture.interpolate, texture.repeat = True, True
    return texture
