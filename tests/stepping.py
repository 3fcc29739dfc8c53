"""Helpers that evaluate a system under test with fixed inputs, one discrete update at a time."""

from __future__ import annotations

from typing import Any

from pydrake.systems.framework import Context, LeafSystem


def fixed_context(dut: LeafSystem, **inputs: Any) -> Context:
    """Returns a default context of ``dut`` with the named input ports fixed."""
    context = dut.CreateDefaultContext()
    for name, value in inputs.items():
        dut.GetInputPort(name).FixValue(context, value)
    return context


def update(dut: LeafSystem, context: Context, *, period: float, times: int = 1) -> None:
    """Performs the periodic discrete update ``times`` times, and advances the time by one period after each."""
    for _ in range(times):
        values = dut.EvalUniquePeriodicDiscreteUpdate(context)
        context.SetDiscreteState(values)
        context.SetTime(context.get_time() + period)


def update_unrestricted(dut: LeafSystem, context: Context, *, period: float, times: int = 1) -> None:
    """Performs the forced unrestricted update ``times`` times, and advances the time by one period after each."""
    for _ in range(times):
        after = context.Clone()
        dut.CalcForcedUnrestrictedUpdate(context, after.get_mutable_state())
        context.SetTimeStateAndParametersFrom(after)
        context.SetTime(context.get_time() + period)
