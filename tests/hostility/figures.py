"""What a part counts."""

from dataclasses import asdict, dataclass, field


@dataclass
class Counted:
    """Figures of a part, and in words what came through."""

    faults: list[str] = field(default_factory=list, kw_only=True)

    def fault(self, figure: str, what: str) -> None:
        """Count one thing that came through, and say what."""
        setattr(self, figure, getattr(self, figure) + 1)
        self.faults.append(what)

    def counts(self) -> dict[str, int]:
        """The figures alone."""
        return {name: value for name, value in asdict(self).items() if name != "faults"}
