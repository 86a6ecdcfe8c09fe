"""The relational network: messages between all symbols, then a score for every action."""

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from guided_lgp.policy.relational.encoding import EDGE_FEATURES, NODE_FEATURES
from guided_lgp.policy.relational.geometry import BLIND, Sight
from guided_lgp.policy.relational.heads import Head


class RelationalNetwork(nn.Module):
    """Message passing with the largest message, and one score per action.

    Taking the largest message, not a sum or mean, makes a node's state independent of how many
    others there are that have nothing to say.
    """

    def __init__(
        self, width: int, rounds: int, heads: Mapping[str, Head], sight: Sight = BLIND
    ) -> None:
        super().__init__()
        nodes, edges = len(NODE_FEATURES + sight.nodes), len(EDGE_FEATURES + sight.edges)
        self.embed = nn.Linear(nodes, width)
        self.receive = nn.ModuleList(nn.Linear(width, width) for _ in range(rounds))
        self.send = nn.ModuleList(nn.Linear(width, width, bias=False) for _ in range(rounds))
        self.edge = nn.ModuleList(nn.Linear(edges, width, bias=False) for _ in range(rounds))
        self.hidden = nn.ModuleList(nn.Linear(2 * width, width) for _ in range(rounds))
        self.update = nn.ModuleList(nn.Linear(width, width) for _ in range(rounds))
        self.pool = nn.Linear(width, width)
        self.heads = heads
        for name, head in heads.items():
            inputs = 3 * width + edges if head.holds else 2 * width
            scores = nn.Sequential(nn.Linear(inputs, width), nn.ReLU(), nn.Linear(width, 1))
            self.add_module(name, scores)

    def forward(self, nodes: Tensor, edges: Tensor, held: Tensor) -> Tensor:
        """Scores of all actions of all grippers.

        Args:
            nodes: (B, T, node features).
            edges: (B, T, T, edge features).
            held: (B,) number of the table that the gripper holds, or -1.

        Returns:
            (B, heads, T): of every instruction on each table as its target.
        """
        state = torch.relu(self.embed(nodes))
        for receive, send, edge, hidden, update in zip(
            self.receive, self.send, self.edge, self.hidden, self.update, strict=True
        ):
            said = (send(state)[:, None] + edge(edges)).max(dim=2).values
            heard = torch.relu(receive(state) + said)
            state = state + update(torch.relu(hidden(torch.cat([state, heard], dim=-1))))
        whole = torch.relu(self.pool(state)).max(dim=1, keepdim=True).values.expand_as(state)
        rows = torch.arange(len(held))
        in_hand = state[rows, held][:, None].expand_as(state)
        free = torch.cat([state, whole], dim=-1)
        full = torch.cat([state, whole, in_hand, edges[rows, held]], dim=-1)
        scores = [
            self.get_submodule(name)(full if head.holds else free)
            for name, head in self.heads.items()
        ]
        return torch.stack(scores, dim=1)[..., 0]
