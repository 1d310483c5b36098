"""USD read back by OpenUSD's own library: levels, times, colours, obstacles, and its validators."""

import json

import numpy as np
import pytest

import runs
from exported import opened, write_usd
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.store.series import StepFields, nothing_more
from pdvol.store.writer import RunWriter
from pdvol.studio.export.exports import export_run
from pdvol.studio.export.frames import even_frames
from pdvol.studio.export.parts import plain_names
from pdvol.studio.shown import OBSTACLE, PALETTE, linear_colour

pytest.importorskip("pxr", reason="usd-core is an optional extra")
from pxr import Gf, Usd, UsdGeom, UsdShade

RATE = 24.0  # time codes a second


def points(stage, place: str, code: float) -> np.ndarray:
    return np.array(UsdGeom.Mesh(stage.GetPrimAtPath(f"/run/{place}")).GetPointsAttr().Get(code))


def test_levels_are_variants_with_their_rest_state(solid_run, tmp_path):
    (file,), _ = export_run(solid_run, "usd", tmp_path)
    stage, run = Usd.Stage.Open(str(file)), open_run(solid_run)
    times = stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond(), stage.GetFramesPerSecond()
    assert times == (0, pytest.approx(4 * run.dt * RATE), RATE, RATE)
    variants = stage.GetDefaultPrim().GetVariantSet("level")
    assert variants.GetVariantNames() == ["level_0", "level_1"] and variants.GetVariantSelection() == "level_1"
    for level in run.levels:
        used = np.unique(level.surface[level.mesh.point_bodies[level.surface[:, 0]] == 1])
        stage = opened(file, level.index)
        rest = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/run/bodies/right")).GetPrimvar("rest")
        np.testing.assert_array_equal(rest.Get(), level.rest[used].astype(np.float32))
        assert rest.GetInterpolation() == "vertex"


@pytest.mark.parametrize(("kind", "fps"), [("flat_run", None), ("solid_run", 30.0)])
def test_no_validator_of_openusd_finds_anything(kind, fps, request, tmp_path):
    run = open_run(request.getfixturevalue(kind))
    file = write_usd(run, [0, 1], tmp_path / "a", fps, lambda level: nothing_more)
    UsdValidation = pytest.importorskip("pxr.UsdValidation", reason="usd-core before 25 has no validators")
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    names = {validator.GetMetadata().name for validator in validators}
    context = UsdValidation.ValidationContext(validators)
    for level in (0, 1):
        errors = context.Validate(opened(file, level))
        assert [(error.GetName(), error.GetMessage()) for error in errors] == []
    assert "usdGeomValidators:StageMetadataChecker" in names


def test_materials_have_the_colours_of_pictures(solid_run, tmp_path):
    (file,), _ = export_run(solid_run, "usd", tmp_path)
    stage = Usd.Stage.Open(str(file))
    for place, colour in (("bodies/left", PALETTE[0]), ("bodies/right", PALETTE[1]), ("obstacles/ball", OBSTACLE)):
        prim = stage.GetPrimAtPath(f"/run/{place}")
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        shader, _, _ = material.ComputeSurfaceSource()
        assert shader.GetShaderId() == "UsdPreviewSurface"
        assert shader.GetInput("diffuseColor").Get() == Gf.Vec3f(*linear_colour(colour))
        assert UsdGeom.Mesh(prim).GetDisplayColorAttr().Get()[0] == Gf.Vec3f(*linear_colour(colour))
    np.testing.assert_allclose(linear_colour("#ff8000"), (1.0, 0.2158605, 0.0), atol=1e-7)  # by the sRGB formula


def test_an_obstacle_that_contact_held_back_is_where_it_was(small_run, tmp_path):
    """On level 0 alone the plane of the scene stayed lower."""
    held = {"0.point": np.array([0.0, -0.4]), "0.normal": np.array([0.0, 1.0])}
    moving = {"point": np.tile([0.0, -0.01], (7, 1)), "normal": np.tile([0.0, 1.0], (7, 1))}
    with RunWriter.open(small_run) as writer:
        runs.write_obstacles(writer.path, [{"name": "lift", "kind": "plane", **moving}])
    np.savez(small_run / "levels" / "0" / "late_000003.npz", **held)
    path = write_usd(open_run(small_run), [0, 1], tmp_path / "a")
    for level, step, height in ((0, 2, -0.01), (0, 3, -0.4), (1, 3, -0.01)):
        code = step * runs.DT * RATE
        assert points(opened(path, level), "obstacles/lift", code)[:, 1].max() == pytest.approx(height)


def test_even_frames_reach_the_last_state_they_can(tmp_path):
    assert [(f.code, f.step) for f in even_frames(4, 0.1, 10.0)] == [(0, 0), (1, 1), (2, 2), (3, 3)]
    assert {f.fraction for f in even_frames(101, 0.01, 100.0)} == {1.0}, "rounding makes no interpolated frame"
    assert len(even_frames(101, 0.01, 24.0)) == 25 and even_frames(101, 0.01, 24.0)[-1].step == 100
    assert len(even_frames(2, 0.01, 24.0)) == 1, "the run ends before the second frame"
    assert len(even_frames(1, 0.01, 24.0)) == 1
    for bad in (0.0, -24.0, float("nan"), 1e9):
        with pytest.raises(InputError, match="--fps"):
            even_frames(4, 0.1, bad)
    still = Usd.Stage.Open(
        str(write_usd(open_run(runs.stored_run(tmp_path / "run", 3, (60,), 0)), [0], tmp_path / "a"))
    )
    mesh = UsdGeom.Mesh(still.GetPrimAtPath("/run/bodies/left"))
    assert (still.GetStartTimeCode(), still.GetEndTimeCode()) == (0, 0)
    assert mesh.GetPointsAttr().GetTimeSamples() == [0] and not mesh.GetVelocitiesAttr().HasValue()


@pytest.mark.parametrize("kind", ["flat_run", "solid_run"])
def test_fields_as_primvars(kind, request, tmp_path):
    """Made-up fields: the force is the vertex's number, the stress the cell's number; both grow with time."""
    run = open_run(request.getfixturevalue(kind))
    level = run.levels[1]
    n, m, d = len(level.rest), len(level.cells), level.rest.shape[1]
    force = np.arange(n)[:, None] * np.ones(d)

    def fields(index):
        return lambda step: StepFields({"contact_force": step * force}, {"von_mises": step * np.arange(m) * 1.0})

    stage = opened(write_usd(run, [1], tmp_path / "a", 1 / run.dt, fields), 1)
    facets = level.surface if d == 3 else level.cells
    owners = level.mesh.point_bodies[facets[:, 0]]
    for body, name in enumerate(run.info["bodies"]):
        api = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(f"/run/bodies/{name}"))
        forces, stresses = api.GetPrimvar("contact_force"), api.GetPrimvar("von_mises")
        assert (forces.GetInterpolation(), stresses.GetInterpolation()) == ("vertex", "uniform")
        used = np.unique(facets[owners == body])
        np.testing.assert_allclose(np.array(forces.Get(3))[:, :d], 3 * force[used])
        behind = level.cells[(np.array(stresses.Get(3)) / 3).round().astype(int)]
        for facet, cell in zip(facets[owners == body], behind, strict=True):
            assert set(facet) <= set(cell)


@pytest.mark.parametrize("up, axis", [((0, 0, 1), "Z"), ((0, 2, 0), "Y"), ((0.1, 0, -9), "Z"), ((1, 0, 0.2), "Y")])
def test_upward_in_the_run_is_upward_in_the_stage(solid_run, tmp_path, up, axis):
    run = open_run(solid_run)
    run.info = {**run.info, "up": list(up)}
    stage = opened(write_usd(run, [0], tmp_path / "a"), 0)
    assert UsdGeom.GetStageUpAxis(stage) == axis and UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    matrix = UsdGeom.Xformable(stage.GetDefaultPrim()).ComputeLocalToWorldTransform(0)
    nearest = np.zeros(3)
    nearest[np.argmax(np.abs(up))] = np.sign(up)[np.argmax(np.abs(up))]
    turned = matrix.TransformDir(Gf.Vec3d(*nearest))
    np.testing.assert_allclose(turned, [0, axis == "Y", axis == "Z"], atol=1e-12)


def test_names_of_prims_are_legal_and_different(solid_run, tmp_path):
    names = ["a b", "a_b", "a_b", "a_b_1", "1st", "", "bäll/../x", "a b"]
    plain = plain_names(names)
    assert plain == ["a_b", "a_b_1", "a_b_2", "a_b_1_1", "_1st", "body", "b_ll____x", "a_b_3"]
    run = open_run(solid_run)
    info = json.loads((solid_run / "run.json").read_text())
    run.info = {**info, "bodies": ["ground", "../ball"]}
    stage = opened(write_usd(run, [0], tmp_path / "a"), 0)
    children = {prim.GetName(): prim.GetDisplayName() for prim in stage.GetPrimAtPath("/run/obstacles").GetChildren()}
    assert children == {"ground_1": "ground", "ball": "ball", "ball_1": "ball"}
    bodies = {prim.GetName(): prim.GetDisplayName() for prim in stage.GetPrimAtPath("/run/bodies").GetChildren()}
    assert bodies == {"ground": "ground", "___ball": "../ball"}
