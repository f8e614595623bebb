"""Borrowing: switches reference counting of array arguments off in kernels that make no arrays.

Compiled code counts the references to each array, so that the array is freed with its last reference. A kernel that
gets twenty arrays in a tuple increments and decrements all counts in each call. In a tick of a session this happened
six hundred times and took a quarter of the time. If all arrays of a kernel come from its caller, the caller refers to
them until the kernel returns, so no counting is needed.
"""

from typing import Any

from numba.core import ir, types
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.errors import TypingError
from numba.core.typed_passes import AnnotateTypes

from teleop_core.kernels.compiler.inner_library import InnerLibrary
from teleop_core.kernels.room import room

_LOOKS = frozenset({
    "getattr", "static_getitem", "getitem", "build_tuple", "exhaust_iter", "getiter", "iternext",
    "pair_first", "pair_second", "cast", "phi", "null", "undef", "typed_getitem",
})  # fmt: skip
"""Operations that return a part or a view of their operand."""


@register_pass(mutates_CFG=False, analysis_only=True)
class _Borrowing(AnalysisPass):
    """Switches reference counting off for a function that makes no arrays."""

    _name = "teleop_core_borrowing"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Examine the typed function before code generation."""
        if _is_held(state, state.return_type) and _takes_room(state):
            raise TypingError("its scratch memory is free again when it returns: it must return no array")
        if state.targetctx.enable_nrt and _borrows(state):
            state.targetctx.enable_nrt = False  # applies only to the context of this function
        if state.flags.no_cpython_wrapper and state.flags.no_cfunc_wrapper:  # only kernels can call it
            state.library = InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return False


class Pipeline(Compiler):
    """numba's compiler with the additional step :class:`_Borrowing`."""

    def define_pipelines(self) -> list[Any]:
        """Steps of the compiler."""
        steps = DefaultPassBuilder.define_nopython_pipeline(self.state)
        steps.add_pass_after(_Borrowing, AnnotateTypes)
        steps.finalize()
        return [steps]


def _takes_room(state: Any) -> bool:
    """Whether a function uses :func:`~teleop_core.kernels.room.room`."""
    calls = (call for block in state.func_ir.blocks.values() for call in block.find_exprs(op="call"))
    return any(_called(state, call) is room for call in calls)


def _borrows(state: Any) -> bool:
    """Whether a function neither makes arrays nor stores or returns references to arrays."""
    if _is_held(state, state.return_type):
        return False
    lines = [line for block in state.func_ir.blocks.values() for line in block.body]
    return all(_is_plain(state, line) for line in lines)


def _is_plain(state: Any, line: Any) -> bool:
    """Whether a statement neither makes an array nor stores a reference to one."""
    if isinstance(line, ir.SetItem | ir.StaticSetItem | ir.SetAttr):
        return not _is_held(state, state.typemap[line.value.name])
    if not isinstance(line, ir.Assign) or not isinstance(line.value, ir.Expr):
        return True
    made, expression = state.typemap[line.target.name], line.value
    if expression.op == "call":
        is_room = _called(state, expression) is room
        return is_room or (not _is_held(state, made) and _is_plain_call(state, expression))
    if expression.op == "getitem" and not _is_index(state.typemap[expression.index.name]):
        return False
    return expression.op in _LOOKS or not _is_held(state, made)


def _called(state: Any, call: Any) -> object:
    """Python function that a call names, if numba itself supports this function."""
    return getattr(state.typemap[call.func.name], "typing_key", None)


def _is_plain_call(state: Any, call: Any) -> bool:
    """Whether the called function is a kernel, which counts references itself, or does not use arrays."""
    function = state.typemap[call.func.name]
    if isinstance(function, types.Dispatcher | types.FunctionType):
        return True
    arguments = [*call.args, *(value for _, value in call.kws)]
    is_length = _called(state, call) is len
    return is_length or not any(_is_held(state, state.typemap[one.name]) for one in arguments)


def _is_index(kind: Any) -> bool:
    """Whether an index gives a view: numbers and slices give views, index arrays give copies."""
    parts: Any = kind if isinstance(kind, types.BaseTuple) else (kind,)
    views = types.Integer | types.SliceType | types.EllipsisType | types.NoneType
    return all(isinstance(part, views) for part in parts)


def _is_held(state: Any, kind: Any) -> bool:
    """Whether values of a type are reference-counted."""
    held: bool = state.targetctx.data_model_manager[kind].contains_nrt_meminfo()
    return held
