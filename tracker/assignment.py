"""The assignment of least cost, whose library is imported when it is first needed.

SciPy's optimisers are slow to import; a server that only shows its page need not wait for them.
"""

from __future__ import annotations

from jaxtyping import Float, Int
from numpy import ndarray


def linear_sum_assignment(
    cost: Float[ndarray, "rows columns"], maximize: bool = False
) -> tuple[Int[ndarray, " pairs"], Int[ndarray, " pairs"]]:
    """Pair rows with columns one to one so that the summed cost is least.

    As :func:`scipy.optimize.linear_sum_assignment`, which it calls [Crouse16].

    Args:
        cost: Of pairing each row with each column; may hold +inf where a pair is forbidden.
        maximize: Have the sum largest instead.

    Returns:
        Rows, ascending, and the column of each: as many pairs as the shorter side has.

    Raises:
        ValueError: If a number is NaN, or no assignment has a finite cost.

    [Crouse16] Crouse, "On implementing 2D rectangular assignment algorithms", IEEE Transactions
    on Aerospace and Electronic Systems 52(4), 2016.
    """
    from scipy import optimize

    rows, columns = optimize.linear_sum_assignment(cost, maximize=maximize)
    return rows, columns
