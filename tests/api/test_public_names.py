"""What is public: `dir(pdvol)` and `__all__` list it, every name resolves, has a docstring and complete type hints."""

import inspect
from typing import is_protocol

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


def functions():
    """Public functions, and methods and properties of public classes; energies of laws are UFL's own business."""
    for name in pdvol.__all__:
        thing = getattr(pdvol, name)
        if inspect.isclass(thing):
            for key, member in vars(thing).items():
                member = member.fget if isinstance(member, property) else inspect.unwrap(member)
                generated = getattr(getattr(member, "__code__", None), "co_filename", "<") == "<string>"
                if inspect.isfunction(member) and key != "psi" and not generated and not key.startswith("_"):
                    yield f"{name}.{key}", member
            if "__init__" in vars(thing) and not is_protocol(thing):
                yield f"{name}.__init__", thing.__init__
        elif not inspect.ismodule(thing):
            yield name, thing


@pytest.mark.parametrize("name, function", [pytest.param(*pair, id=pair[0]) for pair in functions()])
def test_type_hints_are_complete(name, function):
    signature = inspect.signature(function)
    for parameter in signature.parameters.values():
        assert parameter.name in ("self", "cls") or parameter.annotation is not parameter.empty, parameter.name
    assert name.endswith(".__init__") or signature.return_annotation is not signature.empty


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="No pdvol attribute simulate"):
        pdvol.simulate  # noqa: B018
