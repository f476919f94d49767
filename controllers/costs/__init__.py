"""Costs: tuples of terms, each a plain function over named scalars.

`cost` has the terms, the cost and its evaluation. `race` is the cost of a race, with the files
beside it for its parts; `reference` follows a path, and `keep_clear` keeps a distance to other
vehicles.
"""

from quadsim.controllers.costs.cost import (
    NO_PARAMS,
    AmountTerm,
    Cost,
    EstimatedTerm,
    Evaluated,
    NumberTuple,
    Obstacles,
    StateTerm,
    StepFunction,
    Term,
    Weight,
    crash,
    evaluate,
    is_weight,
    number_name,
)

__all__ = [
    "NO_PARAMS",
    "AmountTerm",
    "Cost",
    "EstimatedTerm",
    "Evaluated",
    "NumberTuple",
    "Obstacles",
    "StateTerm",
    "StepFunction",
    "Term",
    "Weight",
    "crash",
    "evaluate",
    "is_weight",
    "number_name",
]
