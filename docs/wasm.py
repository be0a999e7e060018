"""The stepper for the live page: `hopping_leg.sim.stepper`, compiled to WebAssembly.

Numba makes LLVM code of the functions; LLVM, which comes with numba, makes an object of it for
another machine. An object for WebAssembly is a module but for its exports, which are added here.
``python docs/wasm.py`` writes the module to standard output.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from typing import Any

PLAIN = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
PLAIN |= {"NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}
"""Numba reads at its import what keeps its code free of what this computer alone can do."""

_CUSTOM, _EXPORT, _AFTER_EXPORTS = 0, 7, (8, 9, 10, 12)
"""Sections of a module by their numbers."""
_SYMBOL_TABLE, _FUNCTION, _DATA, _GLOBAL = 8, 0, 1, 2
"""What the section "linking" lists."""
_UNDEFINED, _NAMED = 0x10, 0x40
"""Flags of its symbols."""


@cache
def stepper_module() -> bytes:
    """Return the module with ``step`` and ``read``; see ``_functions`` for what they take."""
    environment = os.environ | PLAIN
    command = [sys.executable, __file__]
    return subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True).stdout


def _functions() -> dict[str, tuple[Any, Any]]:
    """Return the exports: signatures and functions of one leg, on addresses of its numbers."""
    import numba
    from numba import carray, types

    from hopping_leg.sim import stepper
    from hopping_leg.sim.leg_table import LEG

    plain = numba.njit(error_model="numpy", forceinline=True)
    send, step_leg = stepper.send, plain(stepper.step_leg.py_func)
    read_sensors = plain(stepper.read_sensors.py_func)
    command_size, scratch_shape = stepper.COMMAND, stepper.SCRATCH
    numbers = types.CPointer(types.float64)
    leg = types.CPointer(numba.from_dtype(LEG))
    memory = types.CPointer(numba.from_dtype(stepper.MEMORY))
    whole, real = types.int32, types.float64

    def step(p, leg, state, past, depth, command, arrival, rows, push, steps, dt):  # noqa: ANN001, ANN202
        """Send a command, (``COMMAND``,), and advance the leg; ``rows`` is scratch."""
        own = carray(leg, 1)
        send(own[0], carray(command, command_size), arrival)
        ring, scratch = carray(past, (depth, 6)), carray(rows, scratch_shape)
        step_leg(carray(p, 1)[0], carray(state, 6), own, ring, scratch, push, steps, dt)

    def read(p, leg, past, depth, draws, reading, dt):  # noqa: ANN001, ANN202
        """Set what the sensors report, (6,), with six standard normal numbers."""
        ring, drawn = carray(past, (1, depth, 6)), carray(draws, (1, 6))
        read_sensors(carray(p, 1), carray(leg, 1), ring, drawn, carray(reading, (1, 6)), dt)

    of_step = (leg, memory, numbers, numbers, whole, numbers, real, numbers, real, whole, real)
    of_read = (leg, memory, numbers, whole, numbers, numbers, real)
    return {"step": (types.void(*of_step), step), "read": (types.void(*of_read), read)}


def build() -> bytes:
    """Return the module; only in a process that began with ``PLAIN``."""
    import llvmlite.binding as llvm
    import numba

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple("wasm32-unknown-unknown")
    machine = target.create_target_machine(opt=3, features="+bulk-memory")
    whole, names = None, []
    for name, (signature, function) in _functions().items():
        compiled = numba.cfunc(signature, error_model="numpy")(function)
        text = _portable(compiled._library.get_llvm_str(), name)
        head = f'target datalayout = "{machine.target_data}"\ntarget triple = "{machine.triple}"\n'
        part = llvm.parse_assembly(head + text)
        names.append(name)
        if whole is None:
            whole = part
        else:
            whole.link_in(part)
    for function in whole.functions:
        if not function.is_declaration and function.name not in names:
            function.linkage = "internal"
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(whole, builder)
    return _with_exports(machine.emit_object(whole), names)


def _portable(code: str, name: str) -> str:
    """Return numba's code under a plain name, without this computer and the interpreter in it."""
    for unused in (r"cfunc\.", r"NRT_decref\(", r"NRT_incref\("):
        code = re.sub(rf"^define [^\n]*@{unused}.*?^\}}\n", "", code, flags=re.M | re.S)
    symbols = re.findall(r"^define [^@]*@(\S+?)\(", code, flags=re.M)
    (own,) = {one for one in symbols if re.match(rf"_ZN.*\d{name}B", one) and "_3clocals_3e" in one}
    code = code.replace(own, name)
    code = re.sub(r"^target [^\n]*$", "", code, flags=re.M)
    code = re.sub(r'"target-[^"]*"="[^"]*"', "", code)
    code = re.sub(r"\bcommon ((?:local_)?(?:unnamed_addr )?global)", r"internal \1", code)
    counted = "define internal void @NRT_{}(ptr %x) alwaysinline {{ ret void }}\n"
    return code + "".join(map(counted.format, ("incref", "decref")))  # nothing is allocated


def _with_exports(module: bytes, names: list[str]) -> bytes:
    sections = list(_sections(module))
    found: dict[str, int] = {}
    for kind, content in sections:
        if kind == _CUSTOM and content[1:8] == b"linking":
            found = dict(_functions_defined(content))
    entries = [_leb(len(name)) + name.encode() + b"\0" + _leb(found[name]) for name in names]
    exports = (_EXPORT, _leb(len(entries)) + b"".join(entries))
    kept = [section for section in sections if section[0] != _CUSTOM]
    place = next(k for k, (kind, _) in enumerate(kept) if kind in _AFTER_EXPORTS)
    kept.insert(place, exports)
    return module[:8] + b"".join(bytes([k]) + _leb(len(c)) + c for k, c in kept)


def _sections(module: bytes) -> Iterator[tuple[int, bytes]]:
    at = 8
    while at < len(module):
        size, begin = _unleb(module, at + 1)
        yield module[at], module[begin : begin + size]
        at = begin + size


def _functions_defined(linking: bytes) -> Iterator[tuple[str, int]]:
    """Yield names and indices; see "Linking" of WebAssembly's tool conventions, version 2."""
    _, at = _unleb(linking, 8)
    while at < len(linking):
        kind = linking[at]
        size, at = _unleb(linking, at + 1)
        end = at + size
        count, at = _unleb(linking, at) if kind == _SYMBOL_TABLE else (0, at)
        for _ in range(count):
            sort, (flags, at) = linking[at], _unleb(linking, at + 1)
            if sort == _DATA:
                size, at = _unleb(linking, at)
                at += size
                for _ in range(0 if flags & _UNDEFINED else 3):
                    _, at = _unleb(linking, at)
                continue
            index, at = _unleb(linking, at)
            if sort in (_FUNCTION, _GLOBAL) and (not flags & _UNDEFINED or flags & _NAMED):
                size, at = _unleb(linking, at)
                if sort == _FUNCTION and not flags & _UNDEFINED:
                    yield linking[at : at + size].decode(), index
                at += size
        at = end


def _leb(number: int) -> bytes:
    out = bytearray()
    while True:
        number, low = number >> 7, number & 127
        out.append(low | (128 if number else 0))
        if not number:
            return bytes(out)


def _unleb(data: bytes, at: int) -> tuple[int, int]:
    number = shift = 0
    while True:
        number |= (data[at] & 127) << shift
        at, shift = at + 1, shift + 7
        if data[at - 1] < 128:
            return number, at


if __name__ == "__main__":
    sys.stdout.buffer.write(build())
