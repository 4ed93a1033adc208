"""How files are spoilt: by bytes, by words, and as trees of YAML whose parts are swapped between files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import yaml
from fuzz.seeds import Seed

# Words as they stand in all of our files; what stands between them stays.
_WORD = re.compile(rb"[A-Za-z_][\w.]*(?:\[[\d:]*\])?|[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?|[^\w\s]")

NUMBERS = (
    "0", "-0", "-0.0", "1", "-1", "2", "3", "0.5", "1e-3", "1e3", "1e-320", "5e-324", "1e308", "-1e308",
    "1e309", "1e400", "1e40", "1e18", "4294967296", "9223372036854775807", "9223372036854775808",
    "-9223372036854775809", "1e6", "100000000", "1e-300", "0x1F", "010", "1_000", "1:30", ".inf", "-.inf",
    ".nan", "nan", "inf", "1e", "1.", ".5", "+1", "1" * 30, "1" * 400, "0.1e-5000",
    "99999999999999999999.5", "½", "１２",
)  # fmt: skip
UNITS = (
    "", "%", "m", "mm", "km", "deg", "rad", "N", "kN", "N*m", "mN*m", "s", "ms", "us", "Hz", "kHz", "mV",
    "nA", "pF", "MOhm", "/s", "1/s", "/mm", "m/s", "m/s^2", "deg/s", "kg", "N/m^99", "m^99999", "m^-1",
    "m^", "/", "m/m/m", "µs", "°", "Ω", "m**2", "fortnight", "mmm", "1/0", "m^1e9", "kkm", "m·s", "s^1/2",
    "%/%", "1", "nS/mV", "hour", "min",
)  # fmt: skip
NAMES = (
    "a", "q1", "w", "x", "input", "self", "pre", "post", "ring", "ring[0]", "ring[0:2]", "ring[-1]",
    "ring[:]", "ring[9]", "ring[1:0]", "a.b", "a.b.c", ".", "..", "a..b", "__class__", "__import__",
    "lambda", "None", "true", "null", "time", "exp", "pi", "e", "inf", "nan", "a b", "a-b", "é", "Ω", "名",
    "🙂", "\u202e", "\u2028", "\ufeff", "\x7f", "a" * 300, "a" * 6000, "../x", "/etc/passwd", "/dev/null",
    "C:\\x", "~", "*", "?", "%s", "{x}", "%(x)s", "$HOME", "`id`", "'", '"', "#", "-", "--", "", " ", "\t",
    "\\", "0", "00", "binn_lateral", "nao", "vehicle", "nao_push", "spoilt", "spoilt.yaml", "circuit",
    "open_loop", "gait_walk_2cm", "main.yaml", "part.yaml",
)  # fmt: skip
EXPRESSIONS = (
    "1/0", "0/0", "sqrt(-1)", "log(0)", "exp(1e9)", "1e308 * 1e308", "x^x^x", "x ** 99999", "10 ^ 400",
    "(" * 60 + "1", "-" * 99 + "1", "+".join(["1"] * 300), "min()", "max(1)", "min(1, 2, 3)", "exp()",
    "exp(1, 2)", "f(x)", "x(1)", "1 1", "1 +", "* 1", ")", "(", "not x", "not not x", "x and y or z",
    "x < y < z", "x == 1", "x != x", "1 if x else 2", "first(x)", "first(first(x))", "max(outside(zmp_y))",
    "duration(x)", "duration(x < 1 m) < 1 s", "total(x)", "mean(x) / 0", "x m", "1 m + 1 s",
    "1 m * 1 s ^ 0.5", "abs(x)", "sin(90 deg)", "cos(90)", "clip(x, 1, 0)", "where(x, 1, 2)", "x[0]", "x.y",
    "'x'", "x; y", "x,y", "sensor(x)", "joint(slide)", "position(torso, y)", "position(torso, q)",
    "position()", "rate(joint(x))", "force(x)", "contact(a, b)", "survived", "ended", "not ended", "rms(x)",
    "random()", "x % 2", "x // 2", "~x", "x | y", "x @ y", "λ", "input^2", "weight * pre", "dx/dt",
    "1e5 % of x", "20N,200ms,left",
)  # fmt: skip
BYTES = (
    b"\x00", b"\xff", b"\xfe\xff", b"\xef\xbb\xbf", b"\xc3", b"\xed\xa0\x80", b"\x1b[31m", b"\t", b"\r",
    b"\r\n", b"\n", b"\n\n", b"\x85", b"\xe2\x80\xa8", b"\x7f", b"\x08", b": ", b"- ", b"{", b"}", b"[",
    b"]", b",", b"#", b"&a ", b"*a", b"!!python/object:os.system ", b"!t ", b"|", b">", b"<<: ", b"? ",
    b"---\n", b"...\n", b"%YAML 1.1\n", b"@", b"`", b"'", b'"', b"\\", b'"\\x00"', b'"\\e"', b'"\\u202e"',
    b"\xf0\x9f\x99\x82", b"0" * 400, b"[" * 60, b"{a: " * 60, b"a" * 5000, b"- " * 60, b"<!DOCTYPE a>",
    b"<!--", b"-->", b"&lt;", b"<a/>", b"</",
)  # fmt: skip


def _quantity(random: Random) -> str:
    gap = random.choice(("", " ", " ", " ", "  "))
    return f"{random.choice(NUMBERS)}{gap}{random.choice(UNITS)}"


def text(random: Random) -> str:
    """A text that may stand as a value: a number, a quantity, a name or an expression."""
    make: Callable[[Random], str] = random.choice(_TEXTS)
    return make(random)


_TEXTS: tuple[Callable[[Random], str], ...] = (
    lambda random: random.choice(NUMBERS),
    _quantity,
    _quantity,
    lambda random: random.choice(NAMES),
    lambda random: random.choice(EXPRESSIONS),
    lambda random: f"{random.choice(EXPRESSIONS)} {random.choice('+-*/^<>')} {text(random)}",
)


class Mutator:
    """Spoils seeds; what it swaps in comes from all of them."""

    def __init__(self, seeds: Sequence[Seed]) -> None:
        self.trees: dict[bytes, Any] = {}
        words: set[bytes] = set()
        for seed in seeds:
            raw = seed.files[seed.spoilt]
            if (tree := _tree_of(seed)) is not None:
                self.trees[raw] = tree
            if seed.spoilt.endswith((".yaml", ".csv", ".xml", ".json")):
                words.update(found for found in _WORD.findall(raw) if len(found) > 1)
        self.words = sorted(words)
        self.donors = [part for tree in self.trees.values() for _, _, part in _parts(tree)]
        self.keys = sorted({str(key) for tree in self.trees.values() for _, key, _ in _parts(tree)})

    def spoil(self, seed: Seed, random: Random) -> bytes:
        """A spoilt copy of a seed's file; one change mostly, sometimes several."""
        raw = seed.files[seed.spoilt]
        ways: list[Callable[[bytes, Random], bytes]] = [self._words, self._lines, _bytes]
        if not seed.spoilt.endswith((".yaml", ".csv", ".xml", ".json")):
            ways = [_bytes]
        elif raw in self.trees or _tree_of(seed) is not None:
            ways += [self._tree, self._tree, self._tree, self._words]
        way = random.choice(ways)
        if way == self._tree:
            return self._tree(self.trees.get(raw) or _tree_of(seed), random)
        for _ in range(random.choice((1, 1, 1, 2, 3, 6))):
            raw = way(raw, random)
        return raw

    def _words(self, raw: bytes, random: Random) -> bytes:
        """Another word in the place of one, or beside it."""
        found = list(_WORD.finditer(raw))
        if not found:
            return _bytes(raw, random)
        at = random.choice(found)
        own = random.random() < 0.5
        new = random.choice(self.words) if own else text(random).encode("utf-8", "surrogatepass")
        kept = random.choice((b"", b"", b"", at.group(), at.group() + b" "))
        return raw[: at.start()] + kept + new + raw[at.end() :]

    def _lines(self, raw: bytes, random: Random) -> bytes:
        """A line left out, repeated, moved, indented, or taken from elsewhere."""
        lines = raw.splitlines(keepends=True)
        if not lines:
            return _bytes(raw, random)
        at, other = random.randrange(len(lines)), random.randrange(len(lines))
        way = random.randrange(6)
        if way == 0:
            del lines[at]
        elif way == 1:
            lines.insert(other, lines[at])
        elif way == 2:
            lines[at], lines[other] = lines[other], lines[at]
        elif way == 3:
            lines[at] = b" " * random.choice((1, 2, 4)) + lines[at]
        elif way == 4:
            lines[at] = lines[at].lstrip()
        else:
            lines[at:at] = random.choice(list(self.trees)).splitlines(keepends=True)[:1]
        return b"".join(lines)

    def _tree(self, whole: Any, random: Random) -> bytes:
        """Parts of a tree changed; as JSON, which is YAML, so that quotes are right."""
        tree = json.loads(json.dumps(whole, default=str))
        for _ in range(random.choice((1, 1, 1, 2, 3))):
            parts = _parts(tree)
            if not parts:
                break
            holder, key, part = random.choice(parts)
            self._change(holder, key, part, random)
        return json.dumps(tree, indent=1, ensure_ascii=random.random() < 0.2).encode("utf-8", "surrogatepass")

    def _change(self, holder: Any, key: Any, part: Any, random: Random) -> None:
        way = random.randrange(10)
        if way == 0:
            del holder[key]
        elif way == 1 and isinstance(holder, dict):
            holder[random.choice((random.choice(self.keys), random.choice(NAMES)))] = part
        elif way == 2 and isinstance(holder, dict):
            holder[random.choice((random.choice(self.keys), random.choice(NAMES)))] = holder.pop(key)
        elif way == 3:
            odd = (
                None,
                True,
                False,
                [],
                {},
                "",
                0,
                -1,
                1e308,
                10**20,
                5e-324,
                [[]],
                {"": 1},
                [None],
                [part, part],
            )
            holder[key] = random.choice(odd)
        elif way == 4:
            holder[key] = random.choice(([part], {"a": part}, [part] * 50, {str(key): part}, str(part)))
        elif way in {5, 6}:
            holder[key] = json.loads(json.dumps(random.choice(self.donors), default=str))
        elif isinstance(part, str) and random.random() < 0.5:
            holder[key] = self._words(part.encode("utf-8", "surrogatepass"), random).decode(
                "utf-8", "replace"
            )
        else:
            holder[key] = text(random)


def _tree_of(seed: Seed) -> Any:
    """The mapping that a seed's file is; None if it is none."""
    if not seed.is_yaml:
        return None
    try:
        tree = yaml.load(seed.files[seed.spoilt], getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except (yaml.YAMLError, ValueError, UnicodeError):  # some files that failed once are no YAML
        return None
    return tree if isinstance(tree, dict) else None


def _parts(tree: Any) -> list[tuple[Any, Any, Any]]:
    """All parts of a tree: what holds it, under what key, itself."""
    found: list[tuple[Any, Any, Any]] = []
    waiting = [tree]
    while waiting:
        holder = waiting.pop()
        pairs = holder.items() if isinstance(holder, dict) else enumerate(holder)
        for key, part in pairs:
            found.append((holder, key, part))
            if isinstance(part, dict | list):
                waiting.append(part)
    return found


def _bytes(raw: bytes, random: Random) -> bytes:
    """Bits turned, bytes put in, left out, repeated or moved; cut short."""
    at = random.randrange(len(raw) + 1)
    end = min(len(raw), at + random.choice((1, 1, 2, 4, 8, 32, 200)))
    before, piece, after = raw[:at], raw[at:end], raw[end:]
    return random.choice(
        (
            before + bytes(byte ^ (1 << random.randrange(8)) for byte in piece[:1]) + piece[1:] + after,
            before + random.randbytes(len(piece)) + after,
            before + after,
            before + piece + piece * random.choice((1, 1, 2, 50)) + after,
            before + random.choice(BYTES) + piece + after,
            before + random.choice(BYTES) + piece + after,
            after + piece + before if random.random() < 0.3 else before,
        )
    )
