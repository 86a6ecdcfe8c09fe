"""YAML, read strictly: no key twice, no number without end, nothing that holds itself."""

import sys
from collections import Counter
from typing import Any

import yaml

_LONGEST_NUMBER = 1100
"""Characters of a number: so many bits has the largest one, and each may be a digit."""


def load_yaml(text: str) -> Any:
    """The document that a text stands for.

    Raises:
        ValueError: it has a key twice, a number that is not finite, or a part that holds itself.
        yaml.YAMLError, LookupError, AttributeError, OverflowError, RecursionError: PyYAML's, for
            what is not YAML, does not fit its tag or is nested too deeply.
    """
    document = _Loader(text).get_single_data()
    _require_an_end(document, frozenset(), set())
    return document


def lone_surrogate(error: UnicodeEncodeError) -> ValueError:
    """What is wrong with a text that cannot be written in UTF-8."""
    code = ord(error.object[error.start])
    return ValueError(f"has a lone surrogate U+{code:04X} in a string")


def _require_an_end(value: Any, above: frozenset[int], known: set[int]) -> None:
    """Refuse a document of which a part holds itself, by an anchor and its alias.

    Args:
        value: a part of the document.
        above: the parts that hold it.
        known: the parts that have an end; aliases can name one a million times.

    Raises:
        ValueError: it has none.
    """
    if isinstance(value, dict | list) and id(value) not in known:
        if id(value) in above:
            raise ValueError("has an alias inside of what it stands for")
        for inner in value.values() if isinstance(value, dict) else value:
            _require_an_end(inner, above | {id(value)}, known)
        known.add(id(value))


class _Loader(yaml.SafeLoader):
    """PyYAML's, which takes the last of several values of a key, and any number and string."""

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Put in place what is merged by ``<<``; of a key, the last value counts.

        The others go at once: mappings that merge each other's would have billions of them.
        """
        count = Counter(filter(None, (_scalar(key) for key, _ in node.value)))
        for (_, key), times in count.items():
            if times > 1:
                raise ValueError(f"has the key {key!r:.40} twice")
        super().flatten_mapping(node)
        last = {_scalar(pair[0]) or id(pair[0]): pair for pair in node.value}
        node.value = list(last.values())

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        value = int(super().construct_yaml_int(_short(node)))
        if abs(value) > sys.float_info.max:
            raise ValueError(f"{node.value[:20]} is not a finite number")
        return value

    def construct_yaml_float(self, node: yaml.ScalarNode) -> float:
        return float(super().construct_yaml_float(_short(node)))

    def construct_yaml_str(self, node: yaml.ScalarNode) -> str:
        value = str(super().construct_yaml_str(node))
        try:
            value.encode("utf-8")
        except UnicodeEncodeError as error:
            raise lone_surrogate(error) from None
        return value


def _scalar(key: yaml.Node) -> tuple[str, str] | None:
    return (key.tag, key.value) if isinstance(key, yaml.ScalarNode) else None


def _short(number: yaml.ScalarNode) -> yaml.ScalarNode:
    """A number whose value can be finite; for others, PyYAML may take minutes."""
    if len(number.value) > _LONGEST_NUMBER:
        raise ValueError(f"{number.value[:20]} is not a finite number")
    return number


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_yaml_int)
_Loader.add_constructor("tag:yaml.org,2002:float", _Loader.construct_yaml_float)
_Loader.add_constructor("tag:yaml.org,2002:str", _Loader.construct_yaml_str)
