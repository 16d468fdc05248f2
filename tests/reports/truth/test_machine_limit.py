"""Operations counted in code of LLVM, against counts by hand; nodes of queries, against their definition."""

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.answer import nodes_taken
from pipeline.analytic.soft_nodes.nodes import BLOCK_NODES, tabulate
from pipeline.models.registry import load_model, pretrained_folder
from pipeline.truth.query import Queries
from reports.truth.machine_limit import Operations, loop_operations, network_of, operations_of, work_of
from weaves.fabric import load_fabric

LOOP = """
define i32 @kernel(ptr %retptr) {
entry:
  %outside = fadd <4 x float> %a, %b
  br label %vector.body
vector.body:                     ; preds = %entry, %vector.body
  %sum = phi <4 x float> [ zeroinitializer, %entry ], [ %next, %vector.body ]
  %other = phi <4 x float> [ zeroinitializer, %entry ], [ %more, %vector.body ]
  %place = phi i64 [ 0, %entry ], [ %after, %vector.body ]
  %x = load <4 x float>, ptr %p, align 4
  %square = fmul reassoc contract <4 x float> %x, %x
  %next = fadd contract <4 x float> %sum, %square
  %twice = fmul <4 x float> %x, splat (float 2.0)
  %part = fdiv <4 x float> %twice, %x
  %back = fsub <4 x float> %part, %twice
  %below = fcmp olt <4 x float> %back, zeroinitializer
  %least = select <4 x i1> %below, <4 x float> %back, <4 x float> zeroinitializer
  %root = tail call <4 x float> @llvm.sqrt.v4f32(<4 x float> %least)
  %more = fadd <4 x float> %other, %root
  %after = add i64 %place, 4
  %done = icmp eq i64 %after, %count
  br i1 %done, label %exit, label %vector.body
exit:
  ret i32 0
}
"""


def test_a_loop_that_was_counted_by_hand():
    """A multiply-add, a product used twice, a quotient, a difference, a choice, a root and a sum: seven."""
    assert loop_operations(LOOP, sums=2) == 7.0
    wider = LOOP.replace("%sum = phi <4 x float>", "%sum = phi <4 x float> [ %q, %entry ]\n  %s1 = phi <4 x float>")
    assert loop_operations(wider.replace("%other =", "%s2 = phi <4 x float> %q\n  %other ="), sums=2) == 3.5
    with pytest.raises(ValueError, match="no loop"):
        loop_operations(LOOP.replace("label %vector.body", "label %exit"), sums=2)


def test_compiled_kernels_have_as_many_operations_as_their_formulas_about():
    """Four quotients of flakes alone take some 40; a node placed in the footprint has its surface to find too."""
    operations = operations_of(tabulate(load_fabric("denim")))
    assert 60 < operations.fixed < operations.in_footprint < 400


def test_nodes_of_wide_and_narrow_footprints():
    fabric = load_fabric("denim")
    table = tabulate(fabric)
    sigma = np.array([50.0, 0.4, 0.05])
    queries = Queries.round(np.ones(3), np.ones(3), sigma, [[0.6, 0.0, 0.8]] * 3, [[0.0, 0.6, 0.8]] * 3)
    taken = nodes_taken(table, queries)
    fixed = int(table.starts[2]) * BLOCK_NODES
    assert taken[:2].tolist() == [[fixed, 0], [fixed, 0]]
    assert taken[2, 0] == 0 and 16 <= taken[2, 1] <= 400 and taken[2, 1] % BLOCK_NODES == 0
    work = work_of(table, queries, Operations(100.0, 1000.0))
    assert work.operations == pytest.approx((2 * fixed * 100.0 + taken[2, 1] * 1000.0) / 3)
    assert work_of(tabulate(fabric, level=8), queries, Operations(1.0, 1.0)).fixed > 2 * work.fixed


def test_the_network_of_selvage():
    """30 features of a query, two layers of 64, and four factors."""
    (selvage,) = load_model(pretrained_folder("selvage"))
    network = network_of(selvage, load_fabric("denim"))
    assert network == (2, 30 * 64 + 64 * 64 + 64 * 4)
