"""Small faults of C++ sources: each replaces one token.

The sources are laid out by clang-format, so a binary operator has a space on both sides, which the brackets
of templates never have."""

from __future__ import annotations

import dataclasses
import random
import re
from collections.abc import Iterator

_TOKEN = re.compile(
    r"""(?P<space>\s+)
      | (?P<comment>//(?:\\\n|[^\n])*|/\*.*?\*/)
      | (?P<directive>(?:(?<=\n)|\A)[ \t]*\#(?:\\\n|[^\n])*)
      | (?P<string>(?:u8|[uUL])?(?:R"(?P<mark>[^()\s]*)\(.*?\)(?P=mark)"|"(?:\\.|[^"\\\n])*"))
      | (?P<char>'(?:\\.|[^'\\\n])+')
      | (?P<number>(?:0[xX][0-9a-fA-F']+|(?:\d[\d']*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\w*)
      | (?P<name>[A-Za-z_]\w*)
      | (?P<operator><=>|->\*?|<<=|>>=|\.\.\.|[-+*/%&|^=!<>]=|&&|\|\||\+\+|--|<<|::|[^\s\w])""",
    re.DOTALL | re.VERBOSE,
)

# Calls whose arguments are texts, or do not change results.
_QUIET = re.compile(r"assert|static_assert|fmt|spdlog|log|reserve|Fail|\w+Error|note_\w+|record_\w+")

_OPERATORS: dict[str, dict[str, tuple[str, ...]]] = {
    "comparison": {
        "<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",),
    },
    "sign": {"+": ("-",), "-": ("+",), "+=": ("-=",), "-=": ("+=",)},
    "dropped term": {"+": ("+ 0 *",), "-": ("- 0 *",)},
    "factor": {"*": ("/",), "/": ("*",), "%": ("*",), "*=": ("/=",), "/=": ("*=",)},
    "condition": {"&&": ("||",), "||": ("&&",)},
}  # fmt: skip

_PAIRS = (
    "min max", "sin cos", "floor ceil", "true false", "lower_bound upper_bound", "any_of all_of", "break continue",
    "x_px y_px", "xx_px2 yy_px2", "width_px height_px", "Add Sub", "MulAdd NegMulAdd", "Le Lt", "Ge Gt",
)  # fmt: skip
_SWAPS = {a: b for pair in map(str.split, _PAIRS) for a, b in (pair, reversed(pair))}
_STATE = re.compile(r"SESSION_STATE_[A-Z]+")


@dataclasses.dataclass(frozen=True)
class Mutant:
    """The fault `kind` in the file `path`: `now` instead of the token `was` at the offset `at`."""

    path: str
    at: int
    line: int
    kind: str
    was: str
    now: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.kind}: '{self.was}' -> '{self.now}'"

    def apply(self, source: str) -> str:
        """The source with the fault."""
        end = self.at + len(self.was)
        if source[self.at : end] != self.was:
            raise ValueError(f"{self.path} has changed: there is no '{self.was}' at {self.at}")
        return source[: self.at] + self.now + source[end:]


@dataclasses.dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    at: int


def _tokens(source: str) -> list[_Token]:
    """Code alone: no space, comments or directives, and no calls of _QUIET."""
    found = [_Token(str(match.lastgroup), match.group(), match.start()) for match in _TOKEN.finditer(source)]
    found = [token for token in found if token.kind not in ("space", "comment", "directive")]
    kept: list[_Token] = []
    i = 0
    while i < len(found):
        if found[i].kind == "name" and _QUIET.fullmatch(found[i].text):
            i += 1
            while i + 1 < len(found) and found[i].text == "::":
                i += 2
            depth = 0
            while i < len(found) and (depth > 0 or found[i].text == "("):
                depth += {"(": 1, ")": -1}.get(found[i].text, 0)
                i += 1
        else:
            kept.append(found[i])
            i += 1
    return kept


def _other_number(text: str) -> str | None:
    """An integer plus one, or twice a float."""
    if re.fullmatch(r"\d+", text):
        return str(int(text) + 1)
    if match := re.fullmatch(r"(\d+\.\d*(?:[eE][+-]?\d+)?)(f?)", text):
        value = float(match[1])
        return f"{2.0 * value if value else 1.0!r}{match[2]}"
    return None


def mutants(path: str, source: str) -> list[Mutant]:
    """All faults of a source, in its order."""
    tokens = _tokens(source)
    states = sorted({token.text for token in tokens if _STATE.fullmatch(token.text)})
    found: list[Mutant] = []
    before = ""
    for token in tokens:
        changes: list[tuple[str, str]] = []
        end = token.at + len(token.text)
        if token.kind == "operator" and source[token.at - 1].isspace() and source[end : end + 1].isspace():
            for kind, operators in _OPERATORS.items():
                changes += [(kind, now) for now in operators.get(token.text, ())]
        elif token.text == "!" or (token.text == "-" and re.fullmatch(r"[(,=?:{]|return", before)):
            changes.append(("condition" if token.text == "!" else "sign", ""))
        elif token.kind == "number" and (number := _other_number(token.text)) is not None:
            changes.append(("constant", number))
        elif token.text in _SWAPS:
            changes.append(("swap", _SWAPS[token.text]))
        elif token.text in states:
            changes += [("state", state) for state in states if state != token.text]
        line = source.count("\n", 0, token.at) + 1
        found += [Mutant(path, token.at, line, kind, token.text, now) for kind, now in changes]
        before = token.text
    return found


def draw(sources: dict[str, str], seed: int) -> Iterator[Mutant]:
    """Faults of all sources, none twice: a kind is as likely as another, and within it a token."""
    by_kind: dict[str, list[Mutant]] = {}
    for path in sorted(sources):
        for mutant in mutants(path, sources[path]):
            by_kind.setdefault(mutant.kind, []).append(mutant)
    chance = random.Random(seed)
    while by_kind:
        kind = chance.choice(sorted(by_kind))
        yield by_kind[kind].pop(chance.randrange(len(by_kind[kind])))
        if not by_kind[kind]:
            del by_kind[kind]
