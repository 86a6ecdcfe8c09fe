"""The relational network: messages between all symbols, then a score for every action."""

import torch
from torch import Tensor, nn

from guided_lgp.policy.relational.encoding import EDGE_FEATURES, NODE_FEATURES


class RelationalNetwork(nn.Module):
    """Message passing with the largest message, and one score per action.

    Taking the largest message, not a sum or mean, makes a node's state independent of how many
    others there are that have nothing to say.
    """

    def __init__(self, width: int, rounds: int) -> None:
        super().__init__()
        nodes, edges = len(NODE_FEATURES), len(EDGE_FEATURES)
        self.embed = nn.Linear(nodes, width)
        self.receive = nn.ModuleList(nn.Linear(width, width) for _ in range(rounds))
        self.send = nn.ModuleList(nn.Linear(width, width, bias=False) for _ in range(rounds))
        self.edge = nn.ModuleList(nn.Linear(edges, width, bias=False) for _ in range(rounds))
        self.hidden = nn.ModuleList(nn.Linear(2 * width, width) for _ in range(rounds))
        self.update = nn.ModuleList(nn.Linear(width, width) for _ in range(rounds))
        self.pool = nn.Linear(width, width)
        self.grasp = nn.Sequential(nn.Linear(2 * width, width), nn.ReLU(), nn.Linear(width, 1))
        self.place = nn.Sequential(
            nn.Linear(3 * width + edges, width), nn.ReLU(), nn.Linear(width, 1)
        )

    def forward(self, nodes: Tensor, edges: Tensor, held: Tensor) -> Tensor:
        """Scores of all actions of all grippers.

        Args:
            nodes: (B, T, node features).
            edges: (B, T, T, edge features).
            held: (B,) number of the table that the gripper holds, or -1.

        Returns:
            (B, 2, T): of grasping each table, and of placing what is held on each.
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
        grasp = self.grasp(torch.cat([state, whole], dim=-1))
        place = self.place(torch.cat([state, whole, in_hand, edges[rows, held]], dim=-1))
        return torch.stack([grasp, place], dim=1)[..., 0]
