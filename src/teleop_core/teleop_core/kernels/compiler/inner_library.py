"""Code of kernels that only other kernels call: kept as it is until such a caller is optimised.

Numba optimises each kernel, and makes machine code of it with all kernels that it calls inside, also if only other
kernels will call it. So a kernel is optimised once for each level of calls. An :class:`InnerLibrary` leaves this work
to the kernel that is called by address or from Python, whose code contains all the others.
"""

from typing import Any

from llvmlite import binding
from numba.core.codegen import JITCodeLibrary


class InnerLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code without machine code, for linking into the code of callers."""

    @property
    def codegen(self) -> Any:
        """The code generator, for calls that need no machine code."""
        return _WithoutCode(self._codegen)

    def finalize(self) -> None:
        """Link the called kernels, without optimisation."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, _name: str) -> int:
        """No address, as there is no machine code."""
        self._ensure_finalized()
        return 0

    def serialize_using_object_code(self) -> Any:
        """Form for the cache."""
        return (self.name, _KIND, self._get_module_for_linking().as_bitcode())


_KIND = "inner"


class _WithoutCode:
    """Code generator for a library without machine code."""

    def __init__(self, made: Any) -> None:
        self._made = made

    def __getattr__(self, name: str) -> Any:
        return getattr(self._made, name)

    def set_env(self, _name: str, _environment: Any) -> None:
        """Do nothing: only code that is called from Python has an environment."""


def _loaded(codegen: Any, state: Any) -> Any:
    """Library from the cache."""
    name, kind, data = state
    if kind != _KIND:
        made = _plain(codegen, state)
        if kind == "object":
            made.object_code = data[0]  # numba itself forgets it when it has loaded the code
        return made
    made = InnerLibrary(codegen, name)
    made._final_module = made._shared_module = binding.parse_bitcode(data)
    made._finalized = True
    return made


_LIBRARY: Any = JITCodeLibrary
_plain = _LIBRARY._unserialize
_LIBRARY._unserialize = _loaded
