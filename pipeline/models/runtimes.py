"""Ways to run a trained method: in half precision, compiled, by ONNX Runtime, in 8-bit integers; all on the CPU.

All use the same weights. They differ in speed, and some of them in rounding.

    eager-bf16, eager-fp16   torch's autocast: products of matrices in half precision, encodings and exponentials in
                             single: 8 bits cannot tell places within a repeat, and float16 ends at 65,504
    compile, compile-bf16    torch.compile, which needs a C++ compiler
    onnx                     ONNX Runtime on the exported module
    onnx-int8                the same with weights of 8 bits, and activations rounded to 8 bits as they come

A runtime in single precision (`_EXACT`) must agree with the method itself: both are compared once for every module, and
a difference above `RUNTIME_TOLERANCE` is refused.
"""

import importlib.util
import logging
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from pipeline.compiled.arrays import Float32
from pipeline.models.method import Around, Method
from pipeline.models.network import PerQuery, Portable, one_thread
from pipeline.per_fabric import PerFabric
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from weaves.errors import WorkFailed
from weaves.fabric import Fabric

RUNTIME_TOLERANCE: Final = 1e-4
"""Largest difference of values in single precision: norm of the difference over that of the method's values."""

_STREAM = 0x0A57  # of the queries that modules are compiled and compared on
_COMPARED = 512
_LOADING = Lock()  # torch exports and compiles one module at a time; the benchmark prepares methods on all cores
_MODULES = 1024  # that torch may compile in one process; beyond 8 it would fall back to eager, silently


class _Program(NamedTuple):
    """A module, ready to run."""

    run: Callable[..., Tensor]  # function of inputs and constants that returns components (N, 4)
    saved: int = 0  # bytes saved by its weights, relative to single precision


class Runtime(NamedTuple):
    """A way to run modules."""

    missing: Callable[[], str]  # returns why this machine cannot; empty if it can
    load: Callable[[nn.Module, Sequence[Tensor], int], _Program]
    """Takes a module, its inputs, and the number of inputs (the first ones) that have a row per query."""


def _compiled(module: nn.Module, example: Sequence[Tensor], rows: int, dtype: torch.dtype | None) -> _Program:
    torch._dynamo.config.recompile_limit = _MODULES  # in this thread alone: others must not have to compile again
    run = _rounding(torch.compile(module, fullgraph=True), dtype)
    with _quiet(), torch.inference_mode():
        columns = [column.clone() for column in example[:rows]]  # made in inference mode, as those of queries are
        for column in columns:
            torch._dynamo.mark_dynamic(column, 0)
        run(*columns, *example[rows:])
    return _Program(run)


def _rounding(module: Callable[..., Tensor], dtype: torch.dtype | None) -> Callable[..., Tensor]:
    """Return the module with its products of matrices in `dtype`; None: all of it in single precision."""

    def run(*given: Tensor) -> Tensor:
        with torch.autocast("cpu", dtype=dtype) if dtype else nullcontext():
            return module(*given).float()

    return run


@cache
def _no_compiler() -> str:
    """Return why torch cannot compile on this machine; empty if it can. It compiles a small module to find out."""
    try:
        with _quiet():
            torch.compile(torch.sin, fullgraph=True)(torch.ones(2))
    except Exception as error:  # whatever torch raises, of any version, means the same
        lines = [line for line in str(error).splitlines() if line and not line.endswith("raised:")]
        return f"torch.compile does not work on this machine: {(lines or [type(error).__name__])[0]}"
    return ""


def _onnx(module: nn.Module, example: Sequence[Tensor], rows: int, quantised: bool) -> _Program:
    import onnxruntime

    plain = exported(module, example, rows)
    model = _quantised(plain) if quantised else plain
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    # An input that the answers do not depend on is no input of the graph.
    places = [(int(entry.name.removeprefix("x")), entry.name) for entry in session.get_inputs()]

    def run(*given: Tensor) -> Tensor:
        (answer,) = session.run(None, {name: given[place].numpy() for place, name in places})
        return torch.from_numpy(answer)

    return _Program(run, len(plain) - len(model))


def no_onnx() -> str:
    """Return why this machine cannot export and run ONNX models; empty if it can."""
    lacking = [name for name in ("onnx", "onnxruntime", "onnxscript") if importlib.util.find_spec(name) is None]
    return f"not installed: {', '.join(lacking)}" if lacking else ""


def exported(module: nn.Module, example: Sequence[Tensor], rows: int, names: Sequence[str] = ()) -> bytes:
    """Return a module as an ONNX model; the first `rows` inputs have any length.

    Inputs are named x0, x1, … if no names are given, the output `components`.
    """
    free = torch.export.Dim("rows", min=2)
    shapes = tuple({0: free} if place < rows else None for place in range(len(example)))
    with TemporaryDirectory() as folder, _quiet(), torch.no_grad():
        path = Path(folder) / "model.onnx"
        torch.onnx.export(
            module,
            tuple(example),
            path,
            input_names=list(names) or [f"x{place}" for place in range(len(example))],
            output_names=["components"],
            dynamic_shapes=(shapes,),
            dynamo=True,
            external_data=False,
            verbose=False,
        )
        return path.read_bytes()


def as_onnx(method: Portable, fabric: Fabric, names: Sequence[str]) -> bytes:
    """Return the part of a method that runs for every query of a fabric as an ONNX model.

    What the fabric is encoded as is a constant of the model. `names` are those of the inputs of N rows; those that the
    answers do not depend on are no inputs of the model.
    """
    import onnx

    part = method.per_query(fabric)
    queries = draw_queries(QueryOptions(), fabric.weave.repeat, _STREAM, 0, _COMPARED)
    inputs = [torch.from_numpy(column) for column in part.inputs(queries)]
    constants = [f"constant{place}" for place in range(len(part.constants))]
    model = exported(part.module, [*inputs, *part.constants], len(inputs), [*names, *constants])
    whole = onnx.load_from_string(model)
    for node in whole.graph.node:
        del node.metadata_props[:]  # where its source lies on this machine
    for name, values in zip(constants, part.constants, strict=True):
        (entry,) = (entry for entry in whole.graph.input if entry.name == name)
        whole.graph.input.remove(entry)
        whole.graph.initializer.append(onnx.numpy_helper.from_array(values.numpy(), name))
    return bytes(whole.SerializeToString())


def _quantised(model: bytes) -> bytes:
    """Return an ONNX model with 8-bit weights in all products of matrices."""
    import onnx
    from onnxruntime.quantization import quantize_dynamic

    graph = onnx.load_from_string(model)
    del graph.graph.value_info[:]  # shapes noted by the exporter, which those found again may contradict
    with TemporaryDirectory() as folder, _quiet():
        path = Path(folder) / "model.onnx"
        quantize_dynamic(graph, path)
        return path.read_bytes()


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence the messages of compilers and exporters."""
    level = logging.root.manager.disable
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logging.disable(logging.WARNING)
        try:
            yield
        finally:
            logging.disable(level)


RUNTIMES: Final[dict[str, Runtime]] = {
    "eager-bf16": Runtime(lambda: "", lambda module, *_: _Program(_rounding(module, torch.bfloat16))),
    "eager-fp16": Runtime(lambda: "", lambda module, *_: _Program(_rounding(module, torch.float16))),
    "compile": Runtime(_no_compiler, partial(_compiled, dtype=None)),
    "compile-bf16": Runtime(_no_compiler, partial(_compiled, dtype=torch.bfloat16)),
    "onnx": Runtime(no_onnx, partial(_onnx, quantised=False)),
    "onnx-int8": Runtime(no_onnx, partial(_onnx, quantised=True)),
}
"""Runtimes by name (`reports.options.RuntimeName`)."""

_EXACT: Final = frozenset({"compile", "onnx"})  # in single precision


class RunBy(Around):
    """A method run in another way: its setting, a key of `RUNTIMES`, says which."""

    def __init__(self, method: Portable, runtime: str) -> None:
        super().__init__(method, runtime)
        self._portable, self._runtime = method, runtime
        self._programs: dict[tuple[Any, ...], tuple[nn.Module, _Program]] = {}
        self._ready = PerFabric(self._prepared)

    def prepare(self, fabric: Fabric) -> None:
        """Prepare the method; compile or export its module, unless an earlier fabric's serves this one too.

        WorkFailed if the answers are not the method's own, though they are computed in single precision.
        """
        self._ready.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries outside the domain."""
        part, program = self._ready.of(fabric)
        return part.answered(queries, program.run)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the method's bytes, less what smaller weights save."""
        return self.method.bytes_stored(fabric) - self._ready.of(fabric)[1].saved

    def _prepared(self, fabric: Fabric) -> tuple[PerQuery, _Program]:
        self.method.prepare(fabric)
        part = self._portable.per_query(fabric)
        key = (id(part.module), *(tuple(constant.shape) for constant in part.constants))
        if key in self._programs:
            return part, self._programs[key][1]
        queries = draw_queries(QueryOptions(), fabric.weave.repeat, _STREAM, 0, _COMPARED)
        inputs = [torch.from_numpy(column) for column in part.inputs(queries)]
        with _LOADING, one_thread():  # what is compiled for several threads would be compiled again for one
            program = RUNTIMES[self._runtime].load(part.module, [*inputs, *part.constants], len(inputs))
            if self._runtime in _EXACT:
                self._compare(fabric, part, program, queries)
        # The module is kept beside its program: an identity is another object's once its own is gone.
        self._programs[key] = part.module, program
        return part, program

    def _compare(self, fabric: Fabric, part: PerQuery, program: _Program, queries: Queries) -> None:
        """Compare values with the method's own."""
        own = self.method.predict(fabric, queries)
        difference = np.linalg.norm(part.answered(queries, program.run) - own)
        error = float(difference) / max(float(np.linalg.norm(own)), 1e-30)
        if not error <= RUNTIME_TOLERANCE:
            differ = f"answers differ from the method's own by {error:.1e}, beyond {RUNTIME_TOLERANCE:g}"
            raise WorkFailed(f"{self.name} by {self._runtime} on {fabric.name}: {differ}")


def runs(method: Method, names: Iterable[str]) -> list[Method]:
    """Return the method run in each of these ways that this machine can; none if it is not `Portable`."""
    if not isinstance(method, Portable):
        return []
    return [RunBy(method, name) for name in dict.fromkeys(names) if not RUNTIMES[name].missing()]


def not_run(method: Method, names: Iterable[str]) -> dict[str, str]:
    """Return the ways in which this machine cannot run the method, each with the reason."""
    if not isinstance(method, Portable):
        return {}
    return {name: reason for name in names if (reason := RUNTIMES[name].missing())}
