"""What is public: `dir(pdvol)` and `__all__` list it, every name resolves and has a docstring."""

import pytest

import pdvol


def test_dir_lists_what_is_public():
    names = [name for name in dir(pdvol) if not name.startswith("__")]
    assert names == sorted(pdvol.__all__)
    assert {"run", "open_run", "picture", "Scene", "Contact", "meshes", "InputError"} <= set(names)
    assert not {"run_scene", "refine_run", "os", "import_module"} & set(names)
    assert "__version__" in dir(pdvol)


@pytest.mark.parametrize("name", pdvol.__all__)
def test_every_name_resolves_and_has_a_docstring(name):
    thing = getattr(pdvol, name)
    own = thing.__doc__
    assert own and not own.startswith(f"{name}("), "a dataclass has its signature as its docstring if it lacks one"


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="No pdvol attribute simulate"):
        pdvol.simulate  # noqa: B018
