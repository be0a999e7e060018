"""Eight legs side by side in compiled code: each number is a register of eight floats.

Physics is written once. Numba compiles it for one leg, whose numbers are floats, and for eight,
whose numbers are lanes: a float of each. Arithmetic acts lane by lane and mixes nothing, so that a
leg has the same bits in any company. A comparison of lanes is a mask; instead of an ``if`` there
are ``where`` and ``any_of``, which take the condition of a float, too.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.core.imputils import lower_cast, lower_setattr_generic
from numba.core.typeconv import Conversion
from numba.core.typing import templates

from hopping_leg.sim.compiled import inlined

WIDTH = 8
"""Lanes: what a register of AVX-512 holds; LLVM takes several where they are shorter."""

Number = Any
"""A float, or lanes."""

_Code = Any  # of numba and llvmlite
_MAGIC = 1.5 * 2.0**52  # added and taken away it rounds to a whole number
_PI_2 = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)  # fdlibm's parts of it
_LN_2 = (0.693147180369123816490, 1.90821492927058770002e-10)
_OF_PI_2, _OF_LN_2 = 2 / math.pi, 1 / math.log(2)
_TAYLOR = tuple(1 / math.factorial(k) for k in range(13, -1, -1))
_INDEX, _BYTES = ir.IntType(64), ir.IntType(8).as_pointer()


class _Kind(types.Type):  # type: ignore[misc]
    """Eight of a scalar type, to which a scalar is spread."""

    def __init__(self, name: str, scalar: types.Type, element: ir.Type) -> None:
        super().__init__(name)
        self.scalar, self.vector = scalar, ir.VectorType(element, WIDTH)

    def can_convert_from(self, _: _Code, other: types.Type) -> Conversion | None:
        number = isinstance(other, types.Float | types.Integer) and self.scalar == types.float64
        return Conversion.safe if number or other == self.scalar else None


class _Side(types.Type):  # type: ignore[misc]
    """Address of records side by side, field by field; without a record, of consecutive lanes."""

    def __init__(self, record: _Code) -> None:
        super().__init__(f"side_by_side({record})")
        self.record = record


class _KindModel(extending.models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: _Code, kind: _Kind) -> None:
        super().__init__(manager, kind, kind.vector)


LANES = _Kind("lanes", types.float64, ir.DoubleType())
MASK = _Kind("mask", types.boolean, ir.IntType(1))
_ROW = _Side(None)
extending.register_model(_Kind)(_KindModel)
extending.register_model(_Side)(extending.models.OpaqueModel)


def _spread(context: _Code, build: _Code, of: _Code, to: _Code, value: _Code) -> _Code:
    none, places = ir.Constant(to.vector, ir.Undefined), ir.VectorType(ir.IntType(32), WIDTH)
    one = context.cast(build, value, of, to.scalar)
    first = build.insert_element(none, one, ir.Constant(ir.IntType(32), 0))
    return build.shuffle_vector(first, none, ir.Constant(places, [0] * WIDTH))


for _scalar in (types.Number, types.Boolean):
    lower_cast(_scalar, _Kind)(_spread)


def _define(function: _Code, emit: Callable[..., Any], *cases: tuple[Any, ...]) -> None:
    """Let compiled code call a function, of which ``emit`` builds the instructions.

    A case is types of result and arguments; of those that fit, it takes what converts least.
    """
    kinds = [templates.signature(result, *takes) for result, *takes in cases]
    template = type("Template", (templates.ConcreteTemplate,), {"cases": kinds})
    templates.infer_global(function)(template)
    for _, *takes in cases:
        extending.lower_builtin(function, *takes)(lambda _, build, __, v: emit(build, *v))


def _called(function: str) -> Callable[..., Any]:
    def emit(build: _Code, value: _Code) -> _Code:
        kind = ir.FunctionType(LANES.vector, [LANES.vector])
        name = f"llvm.{function}.v{WIDTH}f64"
        return build.call(cgutils.get_or_insert_function(build.module, kind, name), [value])

    return emit


def where(condition: bool, yes: Number, no: Number) -> Number:
    """Return ``yes`` where the condition holds, else ``no``."""
    return yes if condition else no


def any_of(condition: bool) -> bool:
    """Tell whether a condition holds in any lane."""
    return condition


def power_of_two(whole: Number) -> Number:
    """Return 2 to a whole number from -1022 to 1023."""
    return 2.0**whole


def _any(build: _Code, condition: _Code) -> _Code:
    bits = ir.IntType(WIDTH if isinstance(condition.type, ir.VectorType) else 1)
    return build.icmp_unsigned("!=", build.bitcast(condition, bits), ir.Constant(bits, 0))


def _power(build: _Code, whole: _Code) -> _Code:
    """Move the number's bits to where a float has its exponent."""
    lanes = isinstance(whole.type, ir.VectorType)
    bits = ir.VectorType(_INDEX, WIDTH) if lanes else _INDEX
    offset, places = ([x] * WIDTH if lanes else x for x in (2.0**52 + 1023, 52))
    shifted = build.bitcast(build.fadd(whole, ir.Constant(whole.type, offset)), bits)
    return build.bitcast(build.shl(shifted, ir.Constant(bits, places)), whole.type)


def _at(build: _Code, address: _Code, index: _Code) -> _Code:
    return build.gep(build.bitcast(address, LANES.vector.as_pointer()), [index])


_BINARY, _COMPARED, _MASKS = (LANES, LANES, LANES), (MASK, LANES, LANES), (MASK, MASK, MASK)
_TRUTH, _FLOAT = types.boolean, types.float64
for _add, _subtract in ((operator.add, operator.sub), (operator.iadd, operator.isub)):
    _define(_add, lambda b, x, y: b.fadd(x, y), _BINARY)
    _define(_subtract, lambda b, x, y: b.fsub(x, y), _BINARY)
_define(operator.mul, lambda b, x, y: b.fmul(x, y), _BINARY)
_define(operator.truediv, lambda b, x, y: b.fdiv(x, y), _BINARY)
_SIGNS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, "==": operator.eq}
for _sign, _compare in _SIGNS.items():
    _define(_compare, lambda b, x, y, sign=_sign: b.fcmp_ordered(sign, x, y), _COMPARED)
_define(operator.ne, lambda b, x, y: b.fcmp_unordered("!=", x, y), _COMPARED)
_define(operator.and_, lambda b, x, y: b.and_(x, y), _MASKS)
_define(operator.or_, lambda b, x, y: b.or_(x, y), _MASKS)
_define(operator.invert, lambda b, x: b.not_(x), (MASK, MASK))
_define(operator.neg, lambda b, x: b.fneg(x), (LANES, LANES))
_define(abs, _called("fabs"), (LANES, LANES))
_define(math.sqrt, _called("sqrt"), (LANES, LANES))
# As Python has them where a number is none.
_define(min, lambda b, x, y: b.select(b.fcmp_ordered("<", y, x), y, x), _BINARY)
_define(max, lambda b, x, y: b.select(b.fcmp_ordered(">", y, x), y, x), _BINARY)
_define(any_of, _any, (_TRUTH, _TRUTH), (_TRUTH, MASK))
_define(power_of_two, _power, (_FLOAT, _FLOAT), (LANES, LANES))
_WHERES = (_FLOAT, _TRUTH, _FLOAT, _FLOAT), (LANES, MASK, LANES, LANES)
_define(where, lambda b, condition, yes, no: b.select(condition, yes, no), *_WHERES)
_define(operator.getitem, lambda b, row, i: b.load(_at(b, row, i)), (LANES, _ROW, types.intp))
_SET = (types.void, _ROW, types.intp, LANES)
_define(operator.setitem, lambda b, row, i, x: b.store(x, _at(b, row, i)), _SET)


class _Fields(templates.AttributeTemplate):  # type: ignore[misc]
    key = _Side

    def generic_resolve(self, side: _Side, name: str) -> types.Type:
        return _ROW if isinstance(side.record.fields[name].type, types.NestedArray) else LANES


def _field(build: _Code, side: _Side, address: _Code, name: str) -> _Code:
    return _at(build, address, ir.Constant(_INDEX, side.record.fields[name].offset // 8))


def _get(_: _Code, build: _Code, side: _Side, address: _Code, name: str) -> _Code:
    place = _field(build, side, address, name)
    row = isinstance(side.record.fields[name].type, types.NestedArray)
    return build.bitcast(place, _BYTES) if row else build.load(place)


def _set(_: _Code, build: _Code, sig: _Code, values: _Code, name: str) -> None:
    build.store(values[1], _field(build, sig.args[0], values[0], name))


templates.infer_getattr(_Fields)
extending.lower_getattr_generic(_Side)(_get)
lower_setattr_generic(_Side)(_set)


def _data(context: _Code, build: _Code, sig: _Code, values: _Code) -> _Code:
    address = context.make_array(sig.args[0])(context, build, values[0]).data
    return build.bitcast(address, context.get_value_type(sig.return_type))


@extending.intrinsic  # type: ignore[untyped-decorator]
def side_by_side(_: _Code, numbers: _Code, dtype: _Code) -> _Code:
    """Return (n,) numbers as a record, aligned (n, WIDTH) numbers as records side by side."""
    result = _Side(dtype.dtype) if numbers.ndim == 2 else dtype.dtype
    return result(numbers, dtype), _data


@extending.intrinsic  # type: ignore[untyped-decorator]
def following(_: _Code, record: _Code, index: _Code) -> _Code:
    """Return the record, or the records side by side, so many places behind one."""
    size = record.record.size * WIDTH if isinstance(record, _Side) else record.size

    def build(context: _Code, build: _Code, sig: _Code, values: _Code) -> _Code:
        index = context.cast(build, values[1], sig.args[1], types.intp)
        offset = build.mul(index, ir.Constant(_INDEX, size))
        place = build.gep(build.bitcast(values[0], _BYTES), [offset])
        return build.bitcast(place, values[0].type)

    return record(record, index), build


@inlined
def spread(value: float, like: Number) -> Number:
    """Return a float, or lanes of it if ``like`` is lanes."""
    return where(like == like, value, value)


@inlined
def rounded(x: Number) -> Number:
    """Return the nearest whole number of |x| < 2^51, an even one from half-way."""
    return (x + _MAGIC) - _MAGIC


@inlined
def sincos(x: Number) -> tuple[Number, Number]:
    """Return both of an angle of less than a million, to 2e-16 (fdlibm's polynomials)."""
    n = rounded(x * _OF_PI_2)
    r = ((x - n * _PI_2[0]) - n * _PI_2[1]) - n * _PI_2[2]
    z = r * r
    s = 2.75573137070700676789e-6 + z * (-2.50507602534068634195e-8 + z * 1.58969099521155010e-10)
    s = 8.33333333332248946124e-3 + z * (-1.98412698298579493134e-4 + z * s)
    s = r + z * r * (-1.66666666666666324348e-1 + z * s)
    c = -2.7557314351390663303e-7 + z * (2.08757232129817482790e-9 - z * 1.13596475577881948e-11)
    c = -1.38888888888741095749e-3 + z * (2.48015872894767294178e-5 + z * c)
    one = 1.0 - 0.5 * z
    c = one + (((1.0 - one) - 0.5 * z) + z * z * (4.16666666666666019037e-2 + z * c))
    turn = n - 4.0 * rounded(0.25 * n)  # quarters of a turn, from -2 to 2
    odd, back = abs(turn) == 1.0, abs(turn) == 2.0
    sine, cosine = where(odd, c, s), where(odd, s, c)
    sine = where(back | (turn == -1.0), -sine, sine)
    return sine, where(back | (turn == 1.0), -cosine, cosine)


@inlined
def exp(x: Number) -> Number:
    """Return e to the power of x, from -700 to 700, to 2e-16 of it."""
    x = max(min(x, 700.0), -700.0)
    n = rounded(x * _OF_LN_2)
    r = (x - n * _LN_2[0]) - n * _LN_2[1]
    y = 0.0 * r
    for share in _TAYLOR:
        y = share + r * y
    return y * power_of_two(n)
