"""The decision table holds, it covers every combination of sources, and breaking any line of the code is noticed."""

import ast
import inspect
import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.runtime.decisions import BOUND_ORDER, CASES, REQUIRED, Case, estop, failing, nav, permit, safety, stick
from tests.runtime.in_earnest import is_same, judged
from wallride.runtime.arbitration import command
from wallride.runtime.arbitration.command import LAB_ORDER, Source, SpeedLimit, Verdict, arbitrate, consent, refusal


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.title)
def test_decision(case: Case):
    decision, _ = arbitrate(case.live, case.required, case.order)
    assert (decision.speed_mps, decision.steering_rad) == (case.speed, case.steering)
    assert (decision.driver, decision.winner, decision.reason) == (case.driver, case.winner, case.reason)
    assert decision.brake_mps2 == case.brake
    assert decision.measure == case.measure or (math.isnan(decision.measure) and math.isnan(case.measure))


WORDS = {
    Source.ESTOP: [None, estop(0.0), estop(math.inf)],
    Source.TELEOP: [None, stick(2.0), stick(-1.0)],
    Source.SAFETY: [None, safety(), safety(0.0), safety(0.5), safety(0.0, 0.0), safety(scan=0.9)],
    Source.PERMIT: [None, permit(), permit(0.0)],
    Source.NAVIGATION: [None, nav(1.0), nav(-0.5)],
}


@pytest.mark.parametrize("order", [LAB_ORDER, BOUND_ORDER])
def test_every_combination_of_voices_obeys_the_rules(order):
    """The rules, stated independently of the code, over all combinations of words."""
    for combination in itertools.product(*(WORDS[source] for source in order)):
        live = [word for word in combination if word is not None]
        decision, _ = arbitrate(live, REQUIRED, order)
        words = {word.source: word for word in live}
        driver = next((source for source in order if source in words and source in command.DRIVING), None)
        above = order[: order.index(driver)] if driver else ()
        assert decision.driver is driver
        if driver is None:
            assert decision.speed_mps == 0
            continue
        wish = words[driver].drive.speed_mps
        assert 0 <= decision.speed_mps / wish <= 1, "never faster than asked, never the other way"
        for source in above:
            if source in REQUIRED and source not in words:
                assert decision.speed_mps == 0, f"{source} is silent"
            if source in words:
                assert (
                    -words[source].assessment.reverse_mps <= decision.speed_mps <= words[source].assessment.forward_mps
                )
        free = all(
            (source not in REQUIRED or source in words)
            and (
                source not in words
                or words[source].assessment.forward_mps == words[source].assessment.reverse_mps == math.inf
            )
            for source in above
        )
        stale = driver is Source.NAVIGATION and Source.SAFETY in words and words[Source.SAFETY].scan_stamp_s < 1.0
        if free and not stale:
            assert decision.speed_mps == wish, "nobody objects"


LIMIT = st.one_of(st.floats(), st.sampled_from([0.0, -0.0, math.nan, math.inf, -math.inf, 1e-320, -1e-320]))


@given(
    wish=st.floats(allow_nan=False, allow_infinity=False),
    limits=st.lists(st.tuples(LIMIT, LIMIT, LIMIT), min_size=1, max_size=3),
)
def test_whatever_the_verdicts_are_no_speed_is_larger_than_the_wish_or_against_it(wish, limits):
    caps = [SpeedLimit(Source.SAFETY, Verdict(ahead, back, "?", math.nan, brake), 1.0) for ahead, back, brake in limits]
    decision, _ = arbitrate([*caps, permit(), nav(wish)], REQUIRED, LAB_ORDER)
    assert abs(decision.speed_mps) <= abs(wish)
    assert decision.speed_mps * wish >= 0
    assert decision.brake_mps2 >= 0
    if not all(limit >= 0 for three in limits for limit in three):
        assert decision.speed_mps == 0
        assert decision.reason == "safety answers with what is no limit"


LIMITS = st.sampled_from([0.0, 0.3, 1.0, math.inf])


@given(
    wish=st.tuples(st.floats(-4.0, 4.0), st.floats(-0.34, 0.34)),
    limits=st.tuples(LIMITS, LIMITS),
    steering=st.one_of(st.none(), st.floats(-0.34, 0.34), st.just(math.nan)),
    permitted=LIMITS,
)
def test_a_verdict_makes_nobody_faster_and_steers_only_a_stop(wish, limits, steering, permitted):
    verdict = Verdict(limits[0], limits[1], "because", math.nan, 2.0, steering)
    words = [SpeedLimit(Source.SAFETY, verdict, 1.0), permit(permitted), nav(*wish)]
    decision, _ = arbitrate(words, REQUIRED, LAB_ORDER)
    assert abs(decision.speed_mps) <= abs(wish[0])
    assert decision.speed_mps * wish[0] >= 0.0
    taken = decision.steering_rad != wish[1]
    assert not taken or (decision.speed_mps == 0.0 != wish[0] and decision.winner is Source.SAFETY)
    assert not taken or decision.steering_rad == steering


SWAPS = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.NotEq: ast.Eq, ast.Eq: ast.NotEq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip


def _changes(node):
    """Yield (field, other value) for each way to break one place of a program."""
    match node:
        case ast.Compare(ops=ops):
            for at, operator in enumerate(ops):
                yield "ops", [*ops[:at], SWAPS[type(operator)](), *ops[at + 1 :]]
        case ast.BoolOp(op=operator):
            yield "op", SWAPS[type(operator)]()
        case ast.UnaryOp(op=operator, operand=operand):  # twice is not at all
            yield "operand", ast.UnaryOp(operator, operand)
        case ast.Call(func=ast.Name("min" | "max" as name), args=args):
            other = "list" if len(args) == 1 else "max" if name == "min" else "min"
            yield "func", ast.Name(other, ast.Load())
        case ast.If():
            yield "test", ast.Constant(False)
            yield "test", ast.Constant(True)
        case ast.For():
            yield "iter", ast.Tuple([], ast.Load())
        case ast.Expr(value=ast.Call()):
            yield "value", ast.Constant(None)
        case ast.Constant(value=float(value)):
            yield "value", value + 0.5


def _mutants():
    """Yield the functions that decide, each time with one place broken."""
    tree = ast.parse(inspect.getsource(command))
    names = {"arbitrate", "_drive_under_caps", "_tightest", "_wheels_rad"}
    tree.body = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name in names]
    assert len(tree.body) == len(names)
    for node in list(ast.walk(tree)):
        for field, changed in list(_changes(node)):
            what, before = f"{field} of {ast.unparse(node)}", getattr(node, field)
            setattr(node, field, changed)
            yield what, ast.fix_missing_locations(tree)
            setattr(node, field, before)


def test_breaking_any_line_of_arbitrate_is_noticed():
    assert failing(arbitrate) == []
    unnoticed, total = [], 0
    for what, mutant in _mutants():
        total += 1
        namespace = dict(vars(command))
        exec(compile(mutant, "mutant", "exec"), namespace)  # noqa: S102 - our own source, broken on purpose
        if not failing(namespace["arbitrate"]):
            unnoticed.append(what)
    assert unnoticed == []
    assert total >= 20, "the mutator found too little to break"


def test_a_refusal_stops_both_ways_and_a_consent_limits_neither():
    refused, consented = refusal(Source.SAFETY, "wall"), consent(Source.SAFETY, "clear")
    assert is_same(judged(refused.assessment, 1.0, 0.0), Verdict(0.0, 0.0, "wall"))
    assert is_same(judged(consented.assessment, 1.0, 0.0), Verdict(math.inf, math.inf, "clear"))
