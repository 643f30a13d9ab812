"""Tracklet association: all tracklets are linked into tracks at once, at the least cost.

[ZLN08] Zhang, Li, Nevatia, "Global data association for multi-object tracking using network
flows", CVPR 2008.
[DFJ54] Dantzig, Fulkerson, Johnson, "Solution of a large-scale traveling-salesman problem",
Operations Research 2(4), 1954.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from tracker.corrections.constraints import Constraints

if TYPE_CHECKING:
    from scipy.optimize import LinearConstraint

_FREE: Constraints[int] = Constraints()

_LITTLE = 1.0
"""Loss by colours, in log odds, below which the best chains without colours are accepted. It bounds
how much less they are worth than the best chains with colours."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackletGraph:
    """N tracklets and L possible links between them; costs are negative log odds and add up."""

    use: Float[ndarray, " N"]
    """Cost of each tracklet's boxes being of a person rather than clutter; may be negative."""
    appear: Float[ndarray, " N"]
    """Cost of a track beginning with each tracklet."""
    leave: Float[ndarray, " N"]
    """Cost of a track ending with each tracklet."""
    earlier: Int[ndarray, " L"]
    """Index of the first tracklet of each link."""
    later: Int[ndarray, " L"]
    """Index of the second tracklet of each link."""
    link: Float[ndarray, " L"]
    """Cost of the two being of one person."""
    templates: Float[ndarray, "N G"] | None = None
    """Log likelihood of each tracklet's colours under each of G people with templates, less the
    largest of these, at most 0."""

    def __len__(self) -> int:
        return len(self.use)

    def part(self, nodes: Int[ndarray, " K"], links: Int[ndarray, " M"]) -> TrackletGraph:
        """Select tracklets by ascending index, and those links that connect them."""
        return TrackletGraph(
            self.use[nodes],
            self.appear[nodes],
            self.leave[nodes],
            np.searchsorted(nodes, self.earlier[links]),
            np.searchsorted(nodes, self.later[links]),
            self.link[links],
            None if self.templates is None else self.templates[nodes],
        )

    def with_links(self, chosen: Bool[ndarray, " L"]) -> TrackletGraph:
        """Select some of the links."""
        return replace(
            self, earlier=self.earlier[chosen], later=self.later[chosen], link=self.link[chosen]
        )


def link_tracklets(graph: TrackletGraph, constraints: Constraints[int] = _FREE) -> list[list[int]]:
    """Find the chains of tracklets of the least total cost that satisfy the constraints, exactly.

    A tracklet is clutter, or it begins a chain or follows another tracklet, and ends the chain or
    is followed. The chains minimise

        Σ_used use_i + Σ_first appear_i + Σ_last leave_i + Σ_linked link_ij

    which is the minimum-cost flow of [ZLN08]. With constraints, and the condition that each chain
    has the colours of one of the people with templates, it is an integer program. Tracklets that no
    chain of possible links connects are solved separately, so that a constraint changes nothing
    elsewhere.

    Args:
        graph: The tracklets and their possible links.
        constraints: Constraints on the links. A pair that must be linked and is not among the
            possible ones is added, with the cost of an end and a beginning.

    Returns:
        The tracklets of each chain, in the order of time; chains by their first tracklet.
    """
    if constraints:
        graph = _with_required_links(graph, constraints)
    if (
        not constraints.must_link
    ):  # no optimum has a link that costs more than an end and a beginning
        graph = graph.with_links(
            graph.link <= graph.leave[graph.earlier] + graph.appear[graph.later]
        )
    found: list[list[int]] = []
    for nodes, links in _components(graph):
        if len(nodes) == 1:
            i = int(nodes[0])
            used = graph.use[i] + graph.appear[i] + graph.leave[i] < 0.0
            if (used or i in constraints.targets) and i not in constraints.clutter:
                found.append([i])
            continue
        place = {tracklet: k for k, tracklet in enumerate(nodes.tolist())}
        part = _solve(graph.part(nodes, links), constraints.mapped(place))
        found += [nodes[chain].tolist() for chain in part]
    return sorted(found)


def _components(graph: TrackletGraph) -> Iterator[tuple[Int[ndarray, " K"], Int[ndarray, " M"]]]:
    """Yield the tracklets and links of each connected part of a graph."""
    groups, group = connected_components(_directed(graph, ()), directed=False)
    members = np.argsort(group, kind="stable")
    links = np.argsort(group[graph.earlier], kind="stable")
    ends = np.arange(1, groups)
    yield from (
        zip(
            np.split(members, np.searchsorted(group[members], ends)),
            np.split(links, np.searchsorted(group[graph.earlier][links], ends)),
            strict=True,
        )
        if len(graph)
        else ()
    )


def _with_required_links(graph: TrackletGraph, constraints: Constraints[int]) -> TrackletGraph:
    """Add the links that constraints require and remove those that they forbid.

    For a pair (i, j) that must be linked, the successor of i is j or lies on a path of links from
    i to j, and so does the predecessor of j.
    """
    earlier, later = graph.earlier, graph.later
    pairs = list(zip(earlier.tolist(), later.tolist(), strict=True))
    together = set(constraints.must_link)
    keep = ~np.isin(later, list(constraints.firsts)) & ~np.isin(earlier, list(constraints.lasts))
    keep |= np.array([pair in together for pair in pairs], dtype=bool)
    ways = _directed(graph.with_links(keep), constraints.must_link)
    back = ways.T.tocsr()
    for i, j in constraints.must_link:
        between = _reached(ways, i) & _reached(back, j)
        keep &= (earlier != i) | (later == j) | between[later]
        keep &= (later != j) | (earlier == i) | between[earlier]
    there = {pair for pair, kept in zip(pairs, keep.tolist(), strict=True) if kept}
    more = np.array([pair for pair in constraints.must_link if pair not in there], dtype=np.int64)
    ends, begins = more.reshape(-1, 2).T
    return replace(
        graph,
        earlier=np.concatenate([earlier[keep], ends]),
        later=np.concatenate([later[keep], begins]),
        link=np.concatenate([graph.link[keep], graph.leave[ends] + graph.appear[begins]]),
    )


def _directed(graph: TrackletGraph, more: tuple[tuple[int, int], ...]) -> csr_array:
    """Make the directed graph of the possible links and of further pairs."""
    ends, begins = np.array(more, dtype=np.int64).reshape(-1, 2).T
    rows, columns = np.concatenate([graph.earlier, ends]), np.concatenate([graph.later, begins])
    size = len(graph)
    return coo_array((np.ones(len(rows)), (rows, columns)), shape=(size, size)).tocsr()


def _reached(ways: csr_array, tracklet: int) -> Bool[ndarray, " N"]:
    """Whether each tracklet can be reached from one, itself among them."""
    found = np.zeros(ways.shape[0], dtype=bool)
    found[breadth_first_order(ways, tracklet, return_predecessors=False)] = True
    return found


def _solve(graph: TrackletGraph, constraints: Constraints[int]) -> list[list[int]]:
    """Find the chains of a connected graph: without templates' colours first, which bounds them."""
    chains = _Flow(replace(graph, templates=None), constraints).chains()
    if graph.templates is None or graph.templates.shape[1] < 2:
        return chains
    templates = graph.templates
    loss = -sum(float(templates[chain].sum(axis=0).max()) for chain in chains)
    return chains if loss < _LITTLE else _Flow(graph, constraints).chains()


class _Flow:
    """The association as a flow: each tracklet is entered and left once at most, as one person.

    With x_e^g = 1 for an edge e (a beginning, a link or an end) that is used by person g,

        Σ_{e into i} x_e^g = Σ_{e out of i} x_e^g,   Σ_g Σ_{e into i} x_e^g <= 1

    Two tracklets i and j that must be linked are in one chain: where the chain of i is a set S
    without j, an edge leaves S, Σ_{u∈S, v∉S} x_uv >= 1. Of the n links on a path from i to j that
    cannot be linked one is not made, Σ x_uv <= n - 1. These inequalities are added where a solution
    violates them, until none does, like the subtour eliminations of the travelling salesman
    problem [DFJ54].
    """

    def __init__(self, graph: TrackletGraph, constraints: Constraints[int]) -> None:
        """Write down costs and bounds; edges without an end have -1 there."""
        self._constraints, self._size = constraints, len(graph)
        nodes, none = np.arange(len(graph)), np.full(len(graph), -1)
        self._from = np.concatenate([none, graph.earlier, nodes])
        self._to = np.concatenate([nodes, graph.later, none])
        costs = np.concatenate([graph.appear, graph.link, graph.leave])
        used = np.append(graph.use, 0.0)[self._to]
        templates = np.zeros((len(graph), 1)) if graph.templates is None else graph.templates
        colours = np.vstack([templates, np.zeros(templates.shape[1])])[self._to]
        self._people = templates.shape[1]
        self._costs = ((costs + used)[:, None] - colours).T.ravel()
        allowed = np.ones(len(costs))
        for i, j in constraints.must_link:
            allowed[(self._from == i) & (self._to < 0)] = 0.0
            allowed[(self._to == j) & (self._from < 0)] = 0.0
        self._allowed = np.tile(allowed, self._people)

    def chains(self) -> list[list[int]]:
        """Solve the program, with the violated constraints added until there is none."""
        from scipy.optimize import Bounds, milp  # half a second that a server starts without

        linear, free = self._flow(), 2 if self._people == 1 else 0
        while True:
            # a flow of one commodity without cuts has integral vertices
            whole = int(len(linear) > free)
            found = milp(
                self._costs,
                integrality=np.full(len(self._costs), whole),
                bounds=Bounds(0.0, self._allowed),
                constraints=linear,
                options={"mip_rel_gap": 0.0},
            )
            if found.x is None:
                raise RuntimeError("consistent constraints have no solution")
            used = found.x.reshape(self._people, -1).sum(axis=0) > 0.5
            chains = self._chains(used)
            cuts = list(self._violated(chains))
            if not cuts:
                return chains
            linear += cuts

    def _flow(self) -> list[LinearConstraint]:
        """The equations of the flow, and the bounds on the use of each tracklet."""
        from scipy.optimize import LinearConstraint
        from scipy.sparse import block_diag, hstack

        edges = np.arange(len(self._from))
        shape = self._size, len(edges)
        inward, outward = (
            coo_array((np.ones((ends >= 0).sum()), (ends[ends >= 0], edges[ends >= 0])), shape)
            for ends in (self._to, self._from)
        )
        least, most = np.zeros(self._size), np.ones(self._size)
        certain = {*self._constraints.targets, *(i for p in self._constraints.must_link for i in p)}
        least[list(certain)] = 1.0
        most[list(self._constraints.clutter)] = 0.0
        kept = block_diag([inward - outward] * self._people, format="csr")
        once = hstack([inward] * self._people, format="csr")
        return [LinearConstraint(kept, 0.0, 0.0), LinearConstraint(once, least, most)]

    def _chains(self, used: Bool[ndarray, " E"]) -> list[list[int]]:
        """Follow the used edges from each beginning."""
        after = dict(zip(self._from[used].tolist(), self._to[used].tolist(), strict=True))
        result = []
        for first in self._to[used & (self._from < 0)].tolist():
            chain = [first]
            while (following := after[chain[-1]]) >= 0:
                chain.append(following)
            result.append(chain)
        return result

    def _violated(self, chains: list[list[int]]) -> Iterator[LinearConstraint]:
        """Yield an inequality for each constraint that chains violate."""
        from scipy.optimize import LinearConstraint

        chain_of = {tracklet: chain for chain in chains for tracklet in chain}
        inner = (self._from >= 0) & (self._to >= 0)

        def edges(chosen: Bool[ndarray, " E"]) -> Float[ndarray, "1 F"]:
            return np.tile(chosen & inner, self._people).astype(float)[None]

        for i, j in self._constraints.must_link:
            if j not in (own := chain_of[i]):
                leaving = np.isin(self._from, own) & ~np.isin(self._to, own)
                yield LinearConstraint(edges(leaving), 1.0, np.inf)
        for pair in self._constraints.cannot_link:
            chain = chain_of.get(pair[0], [])
            if pair[1] in chain:
                first, last = sorted(map(chain.index, pair))
                way = pairwise(chain[first : last + 1])
                on_it = sum((self._from == u) & (self._to == v) for u, v in way) > 0
                yield LinearConstraint(edges(on_it), -np.inf, last - first - 1.0)
